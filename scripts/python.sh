#!/usr/bin/env bash
# Tests the Python module: against the command line, against figures of an independent program, and the notebooks of
# examples/. By default the module that `make test` has compiled is imported from a folder, into an environment that is
# kept; with UMBRAVOX_TESTS=full its wheel is built and installed into a fresh environment, which wheel.sh times.
# Without a Python that could, it fails, unless UMBRAVOX_NO_PYTHON=1.
# usage: python.sh [PYTEST ARGUMENTS]
set -euo pipefail
cd "$(dirname "$0")/.."

missing() {
    if [[ ${UMBRAVOX_NO_PYTHON:-} == 1 ]]; then
        echo "skipped: python-module: $1"
        exit 0
    fi
    echo "error: the Python module cannot be tested: $1" >&2
    echo "hint: install Python 3.10 or later with venv; UMBRAVOX_NO_PYTHON=1 skips these tests" >&2
    exit 1
}

python=${PYTHON:-python3}
command -v "$python" >/dev/null || missing "there is no $python"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' || missing "$("$python" --version) is older than 3.10"
"$python" -c 'import venv, ensurepip' 2>/dev/null || missing "$python has no venv (Debian: apt-get install python3-venv)"

folder=${CARGO_TARGET_DIR:-target}/python
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
# The tests look for the program there, from another folder.
export CARGO_TARGET_DIR="${folder%/python}"
cargo=${CARGO:-cargo}
# Python itself offers its symbols; maturin sets it too.
export PYO3_BUILD_EXTENSION_MODULE=1
# Prints packages of pyproject.toml: what the module and its tests import.
packages=$("$python" - <<'END'
import json, os, re
text = open("pyproject.toml").read()
keys = ["dependencies", "test"] + ["objects"] * (os.environ.get("UMBRAVOX_TESTS") == "full")
lists = [re.search(rf"^{key} = (\[.*\])$", text, re.M)[1] for key in keys]
print("\n".join(name for found in lists for name in json.loads(found)))
END
)
# usage: environment FOLDER PACKAGE...   a virtual environment; one of the same packages is kept
environment() {
    local at=$1
    shift
    [[ -x $at/bin/python && $(cat "$at/packages" 2>/dev/null) == "$*" ]] && return
    rm -rf "$at"
    "$python" -m venv "$at"
    "$at/bin/pip" install --quiet --disable-pip-version-check "$@" || missing "pip cannot fetch $*"
    echo "$*" >"$at/packages"
}

if [[ ${UMBRAVOX_TESTS:-} == full ]]; then
    environment "$folder/tools" "maturin>=1.9,<2"
    rm -rf "$folder/wheels" "$folder/venv"
    # Not pip's isolated build, which would fetch maturin again each time. Profile and features are those of the tests, so
    # that only the module is compiled; `make lint` compiles it with the features of a release.
    "$folder/tools/bin/maturin" build --profile dev --features test-build --locked --interpreter "$python" \
        --out "$folder/wheels"
    scripts/wheel.sh "$folder"/wheels/*.whl "$folder/install"
    # shellcheck disable=SC2086
    environment "$folder/venv" $packages
    "$folder/venv/bin/pip" install --quiet --disable-pip-version-check --no-deps "$folder"/wheels/*.whl
else
    # One build for all: the features are those of `make test`.
    "$cargo" build --locked --workspace --exclude umbravox-mpi --lib --bins --tests
    # shellcheck disable=SC2086
    environment "$folder/venv" $packages
    rm -rf "$folder/module"
    mkdir -p "$folder/module"
    cp -r python/umbravox "$folder/module/"
    cp "$CARGO_TARGET_DIR/debug/lib_umbravox.so" "$folder/module/umbravox/_umbravox.abi3.so"
    export PYTHONPATH=$folder/module
fi
# The program with the same features as the module: other features add columns to tables.
"$cargo" test --locked --no-run --test it
# Beside no source that could be imported in its place.
cd python/tests
"$folder/venv/bin/python" -m pytest -q -rs -p no:cacheprovider "$@"
