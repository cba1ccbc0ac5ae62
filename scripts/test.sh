#!/usr/bin/env bash
# Runs every test of every crate: unit, integration and documentation tests, and builds the examples.
# Installs first what is missing of what they need (Debian and its kin): a software Vulkan driver where there is no Vulkan
# driver, a virtual X server for the test of the window, a browser without a screen for the test of the report.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

has_vulkan() {
    # What the user points the loader at counts, whatever it is.
    [ -z "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] || return 0
    local folder IFS=: own="${XDG_DATA_HOME:-${HOME:-}/.local/share}"
    for folder in /etc /usr/local/etc ${XDG_DATA_DIRS:-/usr/local/share:/usr/share} "$own"; do
        if compgen -G "$folder/vulkan/icd.d/*.json" >/dev/null; then
            return 0
        fi
    done
    return 1
}

has_library() {
    PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null | grep -F "$1" >/dev/null
}

# What the tests need and the machine lacks, by Debian's names.
missing=()
# macOS has Metal, and no X server.
if [ "$(uname -s)" = Linux ]; then
    has_vulkan && has_library libvulkan.so.1 || missing+=(mesa-vulkan-drivers libvulkan1)
    # The window loads its libraries as it starts.
    command -v Xvfb >/dev/null && has_library libxkbcommon-x11.so.0 ||
        missing+=(xvfb libx11-xcb1 libxcursor1 libxi6 libxkbcommon0 libxkbcommon-x11-0)
fi
browser=
for name in chromium-headless-shell chromium google-chrome chrome; do
    browser=$browser$(command -v "$name" || true)
done
[ -n "$browser" ] || missing+=(chromium-headless-shell)

if [ ${#missing[@]} -gt 0 ]; then
    as_root=()
    if ! command -v apt-get >/dev/null; then
        echo "Missing, by Debian's names: ${missing[*]}. Install them; Mesa's lavapipe is a Vulkan driver for any CPU." >&2
        exit 1
    fi
    if [ "$(id -u)" -ne 0 ]; then
        if ! command -v sudo >/dev/null; then
            echo "Missing. As root: apt-get install ${missing[*]}" >&2
            exit 1
        fi
        as_root=(sudo)
    fi
    echo "Installing ${missing[*]}"
    "${as_root[@]}" apt-get update
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install --yes --no-install-recommends "${missing[@]}"
fi
if ! command -v cargo >/dev/null; then
    echo "cargo was not found. Install Rust: https://rustup.rs" >&2
    exit 1
fi
# Without target options, so that documentation tests run too; examples are built, benches are not.
exec cargo test --release --workspace "$@"
