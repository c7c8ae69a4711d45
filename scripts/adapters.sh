#!/usr/bin/env bash
# What must hold on any driver, on every software Vulkan that is there: the tests of the device, the search that tries to
# break promises, the stability suite. A driver that ends endless loops in silence, or rounds in its own way, hides what
# another shows.
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

status=0
for name in "${!drivers[@]}"; do
    file=${drivers[$name]}
    if [[ -z $file ]]; then
        echo "skipped: there is no $name"
        continue
    fi
    echo "adapter: $name ($file)"
    folder=$(mktemp -d)
    # What has run there already (TESTED) is not run again.
    [[ $name == "${TESTED:-}" ]] ||
        VK_DRIVER_FILES=$file "$cargo" test --locked --test gpu -- --show-output || status=1
    VK_DRIVER_FILES=$file timeout 1200 "$umbravox" stability -o "$folder" || status=1
    rm -rf "$folder"
done
exit $status
