#!/usr/bin/env bash
# Runs every test of every crate: unit, integration and documentation tests, and builds the examples.
# Installs the software Vulkan driver first where the machine has no Vulkan driver (Debian and its kin).
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

has_loader() {
    PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null | grep -F libvulkan.so.1 >/dev/null
}

install_vulkan() {
    if ! command -v apt-get >/dev/null; then
        echo "No Vulkan driver was found. Install one; Mesa's lavapipe runs on any CPU." >&2
        exit 1
    fi
    local as_root=()
    if [ "$(id -u)" -ne 0 ]; then
        if ! command -v sudo >/dev/null; then
            echo "No Vulkan driver was found. As root: apt-get install mesa-vulkan-drivers libvulkan1" >&2
            exit 1
        fi
        as_root=(sudo)
    fi
    echo "Installing the software Vulkan driver"
    "${as_root[@]}" apt-get update
    "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
        apt-get install --yes --no-install-recommends mesa-vulkan-drivers libvulkan1
}

# macOS has Metal.
if [ "$(uname -s)" = Linux ] && ! { has_vulkan && has_loader; }; then
    install_vulkan
fi
if ! command -v cargo >/dev/null; then
    echo "cargo was not found. Install Rust: https://rustup.rs" >&2
    exit 1
fi
# Without target options, so that documentation tests run too; examples are built, benches are not.
exec cargo test --release --workspace "$@"
