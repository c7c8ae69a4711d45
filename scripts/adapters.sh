#!/usr/bin/env bash
# Runs the device tests and the stability suite on every installed software Vulkan driver. One driver can hide what another
# shows: endless loops that end in silence, or a rounding of its own.
set -euo pipefail
cd "$(dirname "$0")/.."
cargo=${CARGO:-cargo}
umbravox=${CARGO_TARGET_DIR:-target}/debug/umbravox
# Together with a test, so that nothing is compiled twice for other features.
"$cargo" test --locked --no-run --test gpu

declare -A drivers=([llvmpipe]="" [swiftshader]="")
for folder in /usr/share/vulkan/icd.d /usr/local/share/vulkan/icd.d /etc/vulkan/icd.d; do
    for file in "$folder"/lvp_icd*.json; do
        [[ -e $file ]] && drivers[llvmpipe]=$file
    done
done
[[ -e /usr/lib/chromium/vk_swiftshader_icd.json ]] && drivers[swiftshader]=/usr/lib/chromium/vk_swiftshader_icd.json

# ADAPTER_TESTS names modules of the device tests, and STABILITY_CASES cases of the stability suite: all by default.
# LEFT_OUT is an adapter on which neither runs.
read -ra picked <<<"${ADAPTER_TESTS:-}"
status=0
for name in "${!drivers[@]}"; do
    file=${drivers[$name]}
    [[ $name != "${LEFT_OUT:-}" ]] || continue
    if [[ -z $file ]]; then
        echo "skipped: adapter-$name: its driver is not installed"
        continue
    fi
    echo "adapter: $name ($file)"
    folder=$(mktemp -d)
    # What has run there already (TESTED) is not run again. Searches are short here. Skipped are tests of commands and tables
    # (files, interrupts), of pages, which the browser draws, and those of skipped work, which compare a driver with itself.
    [[ $name == "${TESTED:-}" ]] ||
        UMBRAVOX_TESTS=small VK_DRIVER_FILES=$file "$cargo" test --locked --test gpu -- --show-output "${picked[@]}" \
            --skip compare:: --skip cli:: --skip page:: --skip forced:: || status=1
    VK_DRIVER_FILES=$file timeout 2400 "$umbravox" stability ${STABILITY_CASES:+--case "$STABILITY_CASES"} -o "$folder" ||
        status=1
    rm -rf "$folder"
done
exit $status
