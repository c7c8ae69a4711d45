#!/usr/bin/env bash
# Runs the tests and prints a summary: what ran, what failed, how many tests were skipped and why, how long it took.
# usage: test.sh [quick|test|ci|full]    quick: the library's unit tests and the tests without a device; test (the default):
# every test, the slow ones at a small size; ci: these, the Python module's wheel and notebooks, the example method and every
# software Vulkan; full: the same with every test at full size
set -euo pipefail
cd "$(dirname "$0")/.."
run=${1:-test}
cargo=${CARGO:-cargo}
target=${CARGO_TARGET_DIR:-target}
[[ $run != full ]] || export UMBRAVOX_TESTS=full
mkdir -p "$target"
log=$target/tests.log
: >"$log"

# Hides what passing tests print, but for the lines that say what was skipped. Whatever stands below `failures:` is shown.
shown() {
    perl -ne '
        BEGIN { $| = 1 }
        if (/^failures:$/) { ($failing, $passing) = (1, 0) }
        if (/^test result:/) { ($failing, $passing) = (0, 0) }
        if (/^successes:$/ && !$failing) { $passing = 1 }
        next if !$failing && !/^skipped:/ && ($passing || /^$/ || /^test .* \.\.\. ok$/ || /^running \d+ test/
            || /^ +(Compiling|Checking|Downloading|Downloaded|Executable|Fresh) /);
        print'
}

status=0
times=()
step() {
    local name=$1 start=$SECONDS
    shift
    "$@" 2>&1 | tee -a "$log" | shown || status=1
    times+=("$((SECONDS - start)) s $name")
}

if [[ $run == quick ]]; then
    # Without optimisation an edit compiles in seconds instead of minutes, and these tests take three times as long.
    fast=(--config profile.dev.package.umbravox.opt-level=0)
    step "compile" "$cargo" test --locked "${fast[@]}" --no-run --lib --test it
    step "run" "$cargo" test --locked "${fast[@]}" --no-fail-fast --lib --test it -- --show-output
else
    step "compile" "$cargo" test --locked --no-run
    step "run" "$cargo" test --locked --no-fail-fast -- --show-output
    python_size=${UMBRAVOX_TESTS:-}
    [[ $run != ci ]] || python_size=full
    step "Python module" env UMBRAVOX_TESTS="$python_size" scripts/python.sh
fi
if [[ $run == ci || $run == full ]]; then
    # Another feature compiles the library again: without optimisation, since three short tests use it.
    step "example method" "$cargo" test --locked --config profile.dev.package.umbravox.opt-level=0 --features half \
        --test half -- --show-output
    # Without a graphics card and without a choice of driver, the tests have run on llvmpipe.
    [[ -e /dev/dri || -n ${VK_DRIVER_FILES:-} ]] || export TESTED=llvmpipe
    if [[ $run == ci ]]; then
        # CI has 90 minutes, and its machines differ threefold.
        export LEFT_OUT=${TESTED:-}
        export ADAPTER_TESTS="golden blocks invariance tolerance lines halfangle gradient_opacity sat wavelet shading mesh labels clip"
        cases=ordinary,extinction-step-1e4,uniform-1e6,comb-edge-on,shell-grazing,opacity-1-at-a-point,voxels-1-1-100,shear
        export STABILITY_CASES=$cases,grid-one-voxel,values-1e30,nan,light-inside,epsilon-0,samples-opaque,saddle-cells-5
    fi
    step "software adapters" scripts/adapters.sh
fi

echo
echo "summary:"
# Each test program; the last line is that of the Python module's tests.
grep -E '^(     Running|   Doc-tests|test result:|[0-9]+ (passed|failed))' "$log" || true
grep -E '^(test .* (\.\.\. FAILED|has failed)|FAILED |ERROR |error: )' "$log" | sort -u || true
printf '%s\n' "${times[@]}"
# A run that skipped tests must not look complete. A test may say several times what it lacks.
perl -ne '
    $tests{$1}++ if /^skipped: ([^ ]+): /;
    $python += $1 if /^SKIPPED \[(\d+)\]/;
    END { printf "skipped: %d tests\n", keys(%tests) + $python }' "$log"
exit "$status"
