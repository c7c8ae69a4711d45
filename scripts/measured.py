#!/usr/bin/env python3
"""Measures tables on the adapter of this machine and writes docs/results/adapters/ADAPTER.md.

usage: measured.py UMBRAVOX [--adapter NAME] [--only SECTION,...] [--quick]
Sections: methods, bound, stability, cost, growth. All of them take hours on two cores with a software
adapter, and minutes on a graphics card. The file is written after each section; --only leaves its other sections as they
are. --quick takes fewer repeats and rays, to see that all runs, and prints to the screen alone.
A section that fails says so in its place, and the others go on: a card on which something fails is worth a report.
Scans are found where UMBRAVOX_DATA names them (../shared/data); without them the built-in chest stands for all.
"""
import argparse, atexit, json, os, pathlib, re, shutil, subprocess, sys, tempfile, time

ap = argparse.ArgumentParser(usage=__doc__)
ap.add_argument("umbravox"), ap.add_argument("--adapter"), ap.add_argument("--only")
ap.add_argument("--quick", action="store_true")
a = ap.parse_args()
root = pathlib.Path(__file__).resolve().parent.parent
data = pathlib.Path(os.environ.get("UMBRAVOX_DATA", root.parent / "shared" / "data"))
work = pathlib.Path(tempfile.mkdtemp(prefix="measured-"))
atexit.register(shutil.rmtree, work, ignore_errors=True)
LIGHT = ["--light", "dir:0.5,-0.5,0.7071"]
EFFORT = ["--repeats", "1", "--points", "500", "--rays", "100", "--depths", "20"] if a.quick else ["--repeats", "7"]


def ramp(name, points):
    """Writes a transfer function of value and opacity per millimetre; returns its path."""
    path = work / f"{name}.json"
    path.write_text(json.dumps({"name": name, "points": [{"value": v, "opacity": o} for v, o in points]}))
    return str(path)


def scenes():
    """Names of the scenes, and the arguments for volume, transfer function and camera."""
    yield "thorax:128", ["phantom:thorax:128", "--tf", "ct"]
    for name, points, camera in [
        ("CT_AVM", [(190, 0), (310, 0.3)], "--eye 150,-260,160 --target 18.4,17,12 --fov 40"),
        ("engine", [(60, 0), (120, 0.6)], "--eye 300,-300,200 --target 0,0,0 --fov 40"),
    ]:
        scan = data / f"{name}.nii.gz"
        if scan.is_file():
            yield name, [str(scan), "--tf", ramp(name, points), *camera.split()]


class Failed(Exception):
    """A command without a result."""


def run(*words, accepted=(0,)):
    """Output of the program; it exits with status 1 if a row of a table failed."""
    adapter = ["--adapter", a.adapter] if a.adapter else []
    result = subprocess.run([a.umbravox, *map(str, words), *adapter], capture_output=True, text=True)
    if result.returncode not in accepted:
        raise Failed(f"{' '.join(map(str, words))}: status {result.returncode}\n{result.stderr}")
    return result.stdout


def compare(*words, effort=EFFORT):
    """Rows of a comparison; the `note` of a failed row is the reason."""
    folder = tempfile.mkdtemp(dir=work)
    run("compare", *words, *effort, "-o", folder, "--overwrite", accepted=(0, 1))
    path = pathlib.Path(folder) / "compare.json"
    if not path.is_file():
        raise Failed(f"compare {' '.join(map(str, words))}: no table")
    return json.loads(path.read_text())


def cell(value):
    if value is None or value == "":
        return ""
    if isinstance(value, bool):
        return "yes" if value else "**no**"
    if isinstance(value, float):
        return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"
    return str(value)


def table(rows, columns):
    """Markdown table of columns of the comparison, with status and note if a row failed."""
    columns = [*columns, *(["status", "note"] if any(row.get("status") != "ok" for row in rows) else [])]
    lines = ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]
    return "\n".join(lines + ["| " + " | ".join(cell(row.get(c)) for c in columns) + " |" for row in rows])


TIMES = ["scene", "method", "params", "map", "build_ms", "frame_ms", "bytes"]
ERRORS = ["ray_err_max", "point_err_rms", "image_rmse", "bound", "bound_held", "check_ok"]
# Host and device apart, and the clock rate of the card.
SPLIT = ["build_host_ms", "build_gpu_ms", "build_wall_ms", "frame_host_ms", "frame_gpu_ms", "gpu_mhz"]
DIVERGENCE = ["work_divergence_build", "work_longest_build", "work_divergence_frame", "work_longest_frame"]
WORK = ["work_samples", "work_lookups", "work_loads", "work_cells", "work_pieces"]


def methods():
    """`examples/chest.toml`, 320x320, map 256."""
    rows = compare("--scene", root / "examples" / "chest.toml", "--methods", "none;rays;dsm:map=256,epsilon=0.06,0.02,0.005;osm:map=256,layers=8,32,128;dom:map=256,layers=7,31;bom:map=256,layers=7,31")
    return table(rows, TIMES[1:] + ERRORS)


def bound():
    """Every texel and node: a ramp of opacity, a step and an isosurface, three epsilons, map 192."""
    rows = []
    effort = ["--repeats", "1", "--points", "100", "--depths", "40", *(["--rays", "500"] if a.quick else ["--check", "all"])]
    for name, scene in scenes():
        values = {"engine": (60, 120)}.get(name, (190, 310))
        low, high = values
        middle, width = (low + high) / 2, (high - low) / 100
        functions = {
            "ramp": [(low, 0), (high, 0.5)],
            "step": [(middle, 0), (middle + 1e-3, 0.9)],
            "surface": [(middle - width, 0), (middle, 0.9), (middle + width, 0)],
        }
        for kind, points in functions.items():
            tf = ramp(f"{name}-{kind}", points)
            rows += compare(scene[0], "--tf", tf, *LIGHT, "--size", "64x64", "--name", f"{name} {kind}", "--methods", "dsm:map=192,fit=volume,epsilon=0.06,0.02,0.005", effort=effort)
    return table(rows, ["scene", "params", "ray_err_max", "bound", "bound_held", "bound_limited", "rays_tested", "depths_tested"])


def stability():
    """Extreme and ill-conditioned cases, every method."""
    folder = tempfile.mkdtemp(dir=work)
    text = run("stability", "-o", folder, "--overwrite", accepted=(0, 1))
    # The summary; notes on single rows follow it.
    found = re.search(r"^\d+ rows: .*", text, re.M)
    return "```text\n" + (found.group() if found else text.strip()) + "\n```"


def cost():
    """What shadows cost at which error, 512x512, `--step 1`."""
    maps = "192,256,320,384,512"
    rows = []
    for name, scene in scenes():
        rows += compare(*scene, *LIGHT, "--size", "512x512", "--step", "1", "--name", name, "--methods", f"none;dsm:map=auto,{maps};dsm:march=samples,map={maps}")
    return table(rows, [*TIMES[:6], "point_err_rms", "ray_err_max", "check_ok", *SPLIT, *WORK, *DIVERGENCE])


def growth():
    """The same picture and map of larger volumes."""
    rows = []
    for side in (128, 256) if a.quick else (128, 256, 512):
        rows += compare(f"phantom:thorax:{side}", "--tf", "ct", *LIGHT, "--size", "512x512", "--name", f"thorax:{side}", "--methods", "none;dsm:map=512,march=cells,samples")
    return table(rows, [*TIMES, *SPLIT])


sections = {f.__name__: f for f in (methods, bound, stability, cost, growth)}
chosen = a.only.split(",") if a.only else list(sections)
unknown = [name for name in chosen if name not in sections]
if unknown:
    print(f"measured.py: no section {', '.join(unknown)}; there is: {', '.join(sections)}", file=sys.stderr)
    sys.exit(2)
try:
    first = compare("phantom:slab:16", "--size", "16x16", "--methods", "none", effort=["--repeats", "1", "--points", "10", "--rays", "10"])[0]
except (Failed, OSError) as why:
    sys.exit(f"measured.py: {why}")
adapter = first["adapter"]
path = root / "docs" / "results" / "adapters" / (re.sub(r"[^A-Za-z0-9.]+", "-", adapter).strip("-") + ".md")
build = f"umbravox {first['version']}, revision {first['revision']} ({first['profile']}), driver {first['driver']}, {first['threads']} threads of the host, clock `{first['clock']}`"
parts = {}
if path.is_file() and not a.quick:
    # Sections that are not measured now keep their text.
    for text in path.read_text().split("\n## ")[1:]:
        parts[text.split("\n")[0].lower()] = "## " + text.rstrip()
for name in chosen:
    start = time.time()
    print(f"{name} ...", file=sys.stderr, flush=True)
    try:
        body = sections[name]()
    except Exception as why:
        said = f"{type(why).__name__}: {why}"
        body = f"**Failed.**\n```text\n{said}\n```"
        print(said, file=sys.stderr)
    parts[name] = f"## {name.capitalize()}\n{sections[name].__doc__}\n\n{body}\n\n{build}; in {time.time() - start:.0f} s."
    if a.quick:
        print(parts[name] + "\n", flush=True)
        continue
    head = f"# Measured on {adapter}\nWritten by `make measured`. Columns are those of [columns.md](../../columns.md); times are ms, medians."
    path.parent.mkdir(exist_ok=True)
    path.with_suffix(".part").write_text("\n\n".join([head, *(parts[n] for n in sections if n in parts)]) + "\n")
    path.with_suffix(".part").replace(path)
    print(path, file=sys.stderr)
