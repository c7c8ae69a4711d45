#!/usr/bin/env bash
# Checks for what building and running need: cargo, a C linker, a Vulkan driver. On Debian and Ubuntu as root it
# installs what is missing; elsewhere it says exactly what to install and fails.
# usage: setup.sh [--check] [--window] [--tests]    --check never installs; --window adds what X11 windows need, and Xvfb;
# --tests adds that, a browser, SPIR-V's validator, and a second software Vulkan (SwiftShader, which Debian ships with
# chromium)
set -euo pipefail

install=yes
window=no
tests=no
for argument; do
    case $argument in
    --check) install=no ;;
    --window) window=yes ;;
    --tests) tests=yes window=yes ;;
    *) echo "setup: unknown argument $argument" >&2 && exit 1 ;;
    esac
done

fail() {
    echo "setup: $1" >&2
    exit 1
}

# The folders of the Vulkan loader's documentation, system ones first.
vulkan_driver() {
    if [[ -n ${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}} ]]; then
        return 0
    fi
    local folder
    for folder in /etc/vulkan/icd.d /usr/local/etc/vulkan/icd.d /usr/share/vulkan/icd.d \
        /usr/local/share/vulkan/icd.d "${XDG_DATA_HOME:-$HOME/.local/share}/vulkan/icd.d"; do
        compgen -G "$folder/*.json" >/dev/null && return 0
    done
    return 1
}

# Whether the loader knows a library. All is read first: a pipe that is closed early fails under pipefail.
library() {
    local known
    # ldconfig is in sbin, which is not on every user's path.
    known=$(PATH="$PATH:/usr/sbin:/sbin" ldconfig -p 2>/dev/null) || return 1
    [[ $known == *"$1"* ]]
}

command -v cargo >/dev/null || fail "cargo is missing: install Rust 1.95 or later, see https://rustup.rs"
rust=$(cargo --version | cut -d' ' -f2)
[[ $(printf '%s\n' 1.95.0 "${rust%%-*}" | sort -V | head -n1) == 1.95.0 ]] ||
    fail "cargo is $rust but 1.95 or later is needed: run 'rustup update stable'"

# macOS and Windows bring their own driver (Metal, Direct3D 12).
[[ $(uname -s) == Linux ]] || exit 0

missing=()
command -v cc >/dev/null || missing+=(gcc libc6-dev)
library libvulkan.so.1 || missing+=(libvulkan1)
vulkan_driver || missing+=(mesa-vulkan-drivers)
if [[ $window == yes ]]; then
    command -v xvfb-run >/dev/null || missing+=(xvfb xauth)
    # Opened when a window is, so that nothing else needs them.
    for pair in X11-xcb:libx11-xcb1 Xcursor:libxcursor1 Xi:libxi6 Xrandr:libxrandr2 xkbcommon-x11:libxkbcommon-x11-0; do
        library "lib${pair%%:*}.so" || missing+=("${pair##*:}")
    done
fi
if [[ $tests == yes ]]; then
    [[ -e /usr/lib/chromium/vk_swiftshader_icd.json ]] || missing+=(chromium)
    command -v spirv-val >/dev/null || missing+=(spirv-tools)
fi
((${#missing[@]})) || exit 0

if command -v apt-get >/dev/null; then
    if [[ $install == yes && $(id -u) == 0 ]]; then
        echo "setup: installing ${missing[*]}" >&2
        apt-get update -qq >&2
        DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >&2
        exit 0
    fi
    fail "missing: ${missing[*]}; run: sudo apt-get install ${missing[*]}"
fi
fail "missing: a C linker, the Vulkan loader or a Vulkan driver; Fedora: dnf install gcc vulkan-loader
mesa-vulkan-drivers; Arch: pacman -S gcc vulkan-icd-loader vulkan-swrast; or your GPU's own driver"
