#!/usr/bin/env python3
"""Makes oracle_answers.json anew: optical depths of segments through the small volume, by an independent exact integrator.

usage: oracle_answers.py ORACLE.py
ORACLE.py is called with VOLUME.nii TF.json RAYS.txt and prints `optical_depth transmittance` for each segment (world mm).
Needs nibabel.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import nibabel
import numpy as np
from conftest import FUNCTION, small
from test_exact import segments

HERE = Path(__file__).parent


def main():
    voxels, affine = small()
    starts, ends = segments(1, 60, affine, voxels.shape)
    with tempfile.TemporaryDirectory() as folder:
        volume, function, rays = (Path(folder) / name for name in ["v.nii", "tf.json", "rays.txt"])
        nibabel.save(nibabel.Nifti1Image(voxels, affine), volume)
        function.write_text(json.dumps(FUNCTION))
        np.savetxt(rays, np.hstack([starts, ends]), fmt="%.17g")
        told = subprocess.run([sys.executable, sys.argv[1], volume, function, rays], capture_output=True, text=True, check=True)
    depths = [float(line.split()[0]) for line in told.stdout.splitlines()]
    answers = {"by": Path(sys.argv[1]).name, "starts": starts.tolist(), "ends": ends.tolist(), "optical_depth": depths}
    text = json.dumps(answers).replace("], [", "],\n [")
    (HERE / "oracle_answers.json").write_text(text + "\n")


if __name__ == "__main__":
    main()
