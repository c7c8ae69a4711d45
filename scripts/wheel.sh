#!/usr/bin/env bash
# Installs a wheel into a fresh environment, draws a picture, and fails if both take over 60 s, without downloads.
# usage: wheel.sh WHEEL FOLDER    FOLDER: for the environment; UMBRAVOX_NO_GPU=1 draws nothing
set -euo pipefail
wheel=$(realpath "$1")
folder=$2
python=${PYTHON:-python3}
limit_s=60

rm -rf "$folder"
mkdir -p "$folder"
cd "$folder"
"$python" -m venv tools
pip=(tools/bin/pip --quiet --disable-pip-version-check)
"${pip[@]}" download --dest packages "$wheel"

start=$SECONDS
"$python" -m venv venv
venv/bin/pip install --quiet --disable-pip-version-check --no-index --find-links packages umbravox
installed_s=$((SECONDS - start))
if [[ ${UMBRAVOX_NO_GPU:-} == 1 ]]; then
    venv/bin/umbravox info phantom:slab:8 >/dev/null
else
    venv/bin/umbravox render -o first.png
    [[ -s first.png ]]
fi
total_s=$((SECONDS - start))
echo "wheel: $(du -m "$wheel" | cut -f1) MiB, installed in $installed_s s, with a first picture in $total_s s"
((total_s <= limit_s)) || { echo "error: installation and first picture took over $limit_s s" >&2; exit 1; }

# Which systems the wheel runs on. A machine without auditwheel says nothing about the wheel.
if [[ $(uname) == Linux ]] && "${pip[@]}" install auditwheel; then
    tools/bin/auditwheel show "$wheel"
fi
