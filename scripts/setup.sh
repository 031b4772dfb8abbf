#!/usr/bin/env bash
# Brings what a Debian or Ubuntu machine with Rust lacks to build Stylet and to run it on a GPU adapter:
# a linker, the Vulkan loader, and a software Vulkan driver where no driver is there at all.
# Arguments name further programs that are wanted, each in the Debian package of its name: `scripts/setup.sh parallel`.
# Installs nothing when all is there; says what it installs; without apt or the right to use it, it says what is missing
# and goes on (Stylet then runs on its CPU engine).
set -euo pipefail

if ! command -v cargo >/dev/null; then
    echo "setup: cargo is missing. Rust comes from https://rustup.rs (version 1.95 or newer)." >&2
    exit 2
fi

missing=()
for program in "$@"; do
    command -v "$program" >/dev/null || missing+=("$program")
done
command -v cc >/dev/null || missing+=(gcc libc6-dev)
if [ "$(uname -s)" = Linux ]; then
    # The loader: any directory that the linker cache knows.
    { ldconfig -p 2>/dev/null || /sbin/ldconfig -p; } | grep 'libvulkan\.so\.1' >/dev/null || missing+=(libvulkan1)
    # A driver: a manifest where the loader looks, or one named by the user.
    shopt -s nullglob
    manifests=(/usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json /usr/local/share/vulkan/icd.d/*.json
        "${HOME:-/}"/.local/share/vulkan/icd.d/*.json)
    if [ ${#manifests[@]} -eq 0 ] && [ -z "${VK_ICD_FILENAMES:-}${VK_DRIVER_FILES:-}" ]; then
        missing+=(mesa-vulkan-drivers)
    fi
fi

if [ ${#missing[@]} -eq 0 ]; then
    exit 0
fi
if ! command -v apt-get >/dev/null; then
    echo "setup: missing: ${missing[*]} (names of Debian packages); install their like. Going on without." >&2
    exit 0
fi
as_root=()
if [ "$(id -u)" -ne 0 ]; then
    if command -v sudo >/dev/null; then
        as_root=(sudo)
    else
        echo "setup: missing: ${missing[*]}; run as root: apt-get install ${missing[*]}. Going on without." >&2
        exit 0
    fi
fi
echo "setup: installing with apt-get: ${missing[*]}" >&2
"${as_root[@]}" apt-get update -qq
DEBIAN_FRONTEND=noninteractive "${as_root[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
