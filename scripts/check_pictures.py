#!/usr/bin/env python3
"""Pictures of real scans against an independent brute-force oracle: rms over RGBA of `rays` and of `dsm:epsilon=0.005`.

usage: check_pictures.py [ORACLE.py] [--program target/release/umbravox] [--data ../shared/data] [--keep DIR] [--only NAME]
ORACLE.py (or the environment variable UMBRAVOX_ORACLE) is a script with the arguments
    VOLUME TF.json -o OUT.npy --eye --target --up --fov --light --ambient --background --size --steps --shadow-steps
that writes height x width x 4 float32, linear RGB and opacity. Needs numpy, scipy and nibabel. Minutes.
Exit status 1 if the error of a picture exceeds its limit.
"""
import argparse, json, os, subprocess, sys, tempfile
from pathlib import Path

import nibabel as nib
import numpy as np

ALLOWED = {"rays": 0.005, "dsm:epsilon=0.005": 0.015}
SIZE = "48x32"
BACKGROUND = "#20406a"


def points(*rows):
    return [{"value": v, "opacity": o, "color": c} for v, o, c in rows]


# Scan, coloured transfer function, direction from which the camera looks.
SCANS = {
    "CT_AVM": (points((40, 0, "#c04020"), (160, 0.02, "#e08060"), (300, 0.5, "#fff0d0"), (900, 0.9, "#80c0ff")), (0.5, 0.8, 0.35)),
    "CT_pitch": (points((-300, 0, "#ffcc88"), (0, 0.04, "#cc4433"), (200, 0.06, "#ffffff"), (600, 0.7, "#88bbff")), (0.8, 0.5, 0.3)),
    "engine": (points((60, 0, "#4060ff"), (110, 0.05, "#60a0c0"), (160, 0.1, "#ffa040"), (220, 0.8, "#ff3020")), (0.5, 0.7, 0.5)),
}


def vector(v):
    return ",".join(f"{x:.6f}" for x in v)


def sphere(path):
    """Centre and radius of the volume's bounding sphere, world mm."""
    image = nib.load(path)
    corners = np.array(np.meshgrid(*[(-0.5, n - 0.5) for n in image.shape[:3]])).reshape(3, -1).T
    world = nib.affines.apply_affine(image.affine, corners)
    centre = world.mean(0)
    return centre, np.linalg.norm(world - centre, axis=1).max()


def main():
    ap = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    root = Path(__file__).resolve().parent.parent
    ap.add_argument("oracle", nargs="?", default=os.environ.get("UMBRAVOX_ORACLE"))
    ap.add_argument("--program", default=root / "target/release/umbravox", type=Path)
    ap.add_argument("--data", default=os.environ.get("UMBRAVOX_DATA", root / "../shared/data"), type=Path)
    ap.add_argument("--keep", type=Path, help="keep the pictures (and the oracle's answers, which are used again)")
    ap.add_argument("--only", help="only this scan")
    ap.add_argument("--steps", default=1000, type=int)
    ap.add_argument("--shadow-steps", default=500, type=int)
    a = ap.parse_args()
    if not a.oracle:
        sys.exit("check_pictures: name the oracle, or set UMBRAVOX_ORACLE")
    folder = a.keep or Path(tempfile.mkdtemp())
    folder.mkdir(parents=True, exist_ok=True)
    missed = False
    print("| scan | light | method | rms | allowed | largest | pixels off by > 0.02 |\n|---|---|---|---|---|---|---|")
    for name, (tf_points, away) in SCANS.items():
        volume = a.data / f"{name}.nii.gz"
        if a.only not in (None, name):
            continue
        if not volume.exists():
            print(f"skipped: {volume} is not there", flush=True)
            continue
        tf = folder / f"{name}.json"
        tf.write_text(json.dumps({"name": name, "units": "HU", "reference_length_mm": 1.0, "points": tf_points}))
        centre, radius = sphere(volume)
        away = np.array(away) / np.linalg.norm(away)
        # Light from the side, so that shadows cross the visible surface.
        side = np.cross(away, (0, 0, 1.0))
        lights = {"dir": "dir:" + vector(away + 1.2 * side + (0, 0, 0.8)), "point": "point:" + vector(centre + radius * (0.5 * away + 0.7 * side))}
        for kind, light in lights.items():
            shared = [f"--eye={vector(centre + 2.2 * radius * away)}", f"--target={vector(centre)}", "--up=0,0,1", "--fov=36", f"--light={light}",
                      "--ambient=0.15", f"--background={BACKGROUND}", f"--size={SIZE}"]
            answer = folder / f"{name}-{kind}-oracle.npy"
            if not answer.exists():
                subprocess.run([sys.executable, a.oracle, volume, tf, "-o", answer, *shared, "--steps", str(a.steps), "--shadow-steps", str(a.shadow_steps)], check=True)
            want = np.load(answer)
            for method, allowed in ALLOWED.items():
                out = folder / f"{name}-{kind}-{method.split(':')[0]}.npy"
                subprocess.run([a.program, "render", volume, "--tf", tf, "--shadow", method, "-o", out, *shared], check=True)
                error = np.load(out) - want
                rms = float(np.sqrt(np.mean(error**2)))
                missed |= not rms <= allowed
                off = int((np.abs(error).max(2) > 0.02).sum())
                print(f"| {name} | {kind} | {method} | {rms:.5f} | {allowed} | {np.abs(error).max():.4f} | {off} of {error[..., 0].size} |", flush=True)
    sys.exit(missed)


if __name__ == "__main__":
    main()
