#!/usr/bin/env bash
# Builds the Python module's wheel, installs it into a fresh virtual environment, and runs its tests there: against the
# command line, which it builds too, against figures of an independent program, and the notebook of examples/.
# Where there is no Python that could, it says `skipped:` and why.
# usage: python.sh [PYTEST ARGUMENTS]
set -euo pipefail
cd "$(dirname "$0")/.."

skip() {
    echo "skipped: the Python module is not tested: $1"
    exit 0
}

python=${PYTHON:-python3}
command -v "$python" >/dev/null || skip "there is no $python"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || skip "$("$python" --version) is older than 3.10"
"$python" -c 'import venv, ensurepip' 2>/dev/null || skip "$python has no venv (Debian: apt-get install python3-venv)"

folder=${CARGO_TARGET_DIR:-target}/python
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
# The tests look for the program there, from another folder.
export CARGO_TARGET_DIR="${folder%/python}"
rm -rf "$folder/wheels" "$folder/venv"

# What builds it is kept from one run to the next.
tools=$folder/tools
[[ -x $tools/bin/maturin ]] || {
    "$python" -m venv "$tools"
    "$tools/bin/pip" install --quiet --disable-pip-version-check "maturin>=1.9,<2" ||
        skip "pip cannot fetch maturin, which builds it"
}
# Not pip's isolated build, which would fetch maturin again each time.
"$tools/bin/maturin" build --release --locked --interpreter "$python" --out "$folder/wheels"
wheel=$(ls "$folder"/wheels/*.whl)

"$python" -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check "${wheel}[test]" ||
    skip "pip cannot fetch what its tests need"
# The program of the same features as the wheel: what lies there may be of others (its tables then have other columns).
# Together with a test, so that nothing is compiled twice for the features of what only tests need.
"${CARGO:-cargo}" test --locked --no-run --test cli_readme
# Beside no source that could be imported in its place.
cd python/tests
"$folder/venv/bin/python" -m pytest -q -rs -p no:cacheprovider "$@"
