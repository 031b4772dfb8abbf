#!/usr/bin/env bash
# Brings what a Debian or Ubuntu machine with Rust lacks to build Stylet and to run it on a GPU adapter:
# a linker, the Vulkan loader, and a software Vulkan driver where no driver is there at all.
# Arguments name further programs that are wanted, each in the Debian package of its name in small letters:
# `scripts/setup.sh parallel`. The word `window` stands for the libraries that a window needs, `gamepad` and `sound` for
# what a gamepad and tones need to be built in. `screen-reader` needs nothing: what talks to readers is compiled in.
# Installs nothing when all is there; says what it installs; without apt or the right to use it, it says what is missing
# and goes on (Stylet then runs on its CPU engine).
set -euo pipefail

if ! command -v cargo >/dev/null; then
    echo "setup: cargo is missing. Rust comes from https://rustup.rs (version 1.95 or newer)." >&2
    exit 2
fi

missing=()
for program in "$@"; do
    if [ "$program" = window ]; then
        if [ "$(uname -s)" = Linux ]; then
            known=$(ldconfig -p 2>/dev/null || /sbin/ldconfig -p)
            for pair in libX11.so.6=libx11-6 libX11-xcb.so.1=libx11-xcb1 libXcursor.so.1=libxcursor1 libXi.so.6=libxi6 \
                libXrandr.so.2=libxrandr2 libxkbcommon-x11.so.0=libxkbcommon-x11-0; do
                grep -F "${pair%=*}" <<<"$known" >/dev/null || missing+=("${pair#*=}")
            done
        fi
    elif [ "$program" = gamepad ]; then
        if [ "$(uname -s)" = Linux ]; then
            pkg-config --exists libudev 2>/dev/null || missing+=(libudev-dev pkg-config)
        fi
    elif [ "$program" = sound ]; then
        if [ "$(uname -s)" = Linux ]; then
            pkg-config --exists alsa 2>/dev/null || missing+=(libasound2-dev pkg-config)
        fi
    elif [ "$program" = screen-reader ]; then
        :
    elif ! command -v "$program" >/dev/null; then
        missing+=("${program,,}")
    fi
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
