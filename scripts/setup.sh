#!/usr/bin/env bash
# Installs everything skylit needs to build and to run on a software Vulkan driver. Idempotent: a second run only checks.
#
#   ./scripts/setup.sh            installs what is missing, and says what
#   ./scripts/setup.sh --check    changes nothing; exit 1 if something is missing
#
# On Debian 12 it installs, with apt:
#   Vulkan loader, validation layer, vulkan-tools    to run and to test; Python to check the documentation
#   libshaderc-dev, glslang-dev, spirv-tools         the shader compiler that build.rs uses
#   Xvfb, xdotool, libraries of X11                  to open the viewer's window and to test it; nothing else needs a display
#   Mesa 25.0 lavapipe from bookworm-backports       all three tracers on the CPU
# and unpacks Debian's own Mesa 22.3.6 lavapipe beside it (target/drivers/mesa-22.3.6), which is the floor that the compute
# tracer must run on. The mirror is the one the machine's own apt sources name.
set -euo pipefail
cd "$(dirname "$0")/.."
drivers_dir=${SKYLIT_DRIVERS_DIR:-$PWD/target/drivers}
check_only=0
[ "${1:-}" = "--check" ] && check_only=1

say() { printf 'setup: %s\n' "$*"; }
die() { printf 'setup: error: %s\n' "$*" >&2; exit 1; }

needed_elsewhere() {
  cat >&2 <<'TXT'
setup: this machine is not Debian or Ubuntu. Install these with its own package manager, then run the command again:
  - a Rust toolchain (stable, 1.88 or newer), a C++ compiler and Python 3
  - shaderc with its static library libshaderc_combined.a, glslang and SPIRV-Tools development files
    (or build with `--features build-shaderc`, which compiles shaderc from source with cmake, ninja, python3 and git)
  - the Vulkan loader (libvulkan.so.1) and VK_LAYER_KHRONOS_validation
  - a Vulkan 1.3 driver; Mesa's lavapipe 24.1 or newer runs all three tracers on a CPU
TXT
  exit 1
}

if ! command -v apt-get >/dev/null 2>&1 || ! command -v dpkg-query >/dev/null 2>&1; then needed_elsewhere; fi
# shellcheck disable=SC1091  # the file is the machine's own
. /etc/os-release
codename=${VERSION_CODENAME:-unknown}

if [ "$(id -u)" = 0 ]; then sudo=(); elif command -v sudo >/dev/null 2>&1; then sudo=(sudo); else
  die "needs root to install packages: run as root, or install sudo"; fi
apt() { "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=120 "$@"; }
installed() { dpkg-query -W -f '${Status}' "$1" 2>/dev/null | grep -q 'install ok installed'; }
version_of() { dpkg-query -W -f '${Version}' "$1" 2>/dev/null || true; }

updated=0
update_once() { [ "$updated" = 1 ] && return 0; say "refreshing the package lists"; apt update >/dev/null; updated=1; }

# --- build and run-time packages -------------------------------------------------------------------------------------
packages=(g++ python3 pkg-config libvulkan1 vulkan-validationlayers vulkan-tools libshaderc-dev glslang-dev spirv-tools)
# the viewer's window on X11, which is loaded when it opens, and a display without a screen with a hand for its mouse and keys, to test it
packages+=(libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0 xvfb xauth xdotool)
missing=()
for p in "${packages[@]}"; do installed "$p" || missing+=("$p"); done
if [ ${#missing[@]} -gt 0 ]; then
  [ $check_only = 1 ] && die "missing packages: ${missing[*]}"
  update_once
  say "installing ${missing[*]}"
  apt install -y --no-install-recommends "${missing[@]}" >/dev/null
fi

# --- Mesa 25 -----------------------------------------------------------------------------------------------------------
# lavapipe has the ray-tracing extensions since Mesa 24.1; Debian 12 itself ships 22.3.6.
want_mesa=24.1
if ! dpkg --compare-versions "$(version_of mesa-vulkan-drivers)" ge $want_mesa; then
  [ $check_only = 1 ] && die "mesa-vulkan-drivers $want_mesa or newer is missing"
  update_once
  if [ "$codename" = bookworm ]; then
    # apt expands these, not the shell
    # shellcheck disable=SC2016
    if ! apt-get indextargets --format '$(RELEASE)' | grep -qx bookworm-backports; then
      # the archive that serves "bookworm" serves its backports too
      # shellcheck disable=SC2016
      site=$(apt-get indextargets --format '$(RELEASE) $(IDENTIFIER) $(SITE)' | awk '$1=="bookworm" && $2=="Packages" {print $3; exit}')
      [ -n "$site" ] || die "no apt source for bookworm on this machine: cannot tell where its backports are"
      say "adding the bookworm-backports suite of this machine's own mirror"
      printf 'Types: deb\nURIs: %s\nSuites: bookworm-backports\nComponents: main\nSigned-By: /usr/share/keyrings/debian-archive-keyring.gpg\n' "$site" |
        "${sudo[@]}" tee /etc/apt/sources.list.d/skylit-backports.sources >/dev/null
      updated=0; update_once
    fi
    say "installing Mesa's lavapipe from bookworm-backports"
    apt install -y --no-install-recommends -t bookworm-backports mesa-vulkan-drivers >/dev/null
  else
    say "installing this distribution's mesa-vulkan-drivers"
    apt install -y --no-install-recommends mesa-vulkan-drivers >/dev/null
  fi
fi
say "lavapipe: mesa-vulkan-drivers $(version_of mesa-vulkan-drivers)"

# --- the floor driver ----------------------------------------------------------------------------------------------------
# Debian 12's own lavapipe (no ray tracing), unpacked and never installed. Select it with VK_DRIVER_FILES.
if [ "$codename" = bookworm ]; then
  floor=$drivers_dir/mesa-22.3.6
  if [ ! -f "$floor/lvp_icd.json" ]; then
    [ $check_only = 1 ] && die "the floor driver is missing: $floor"
    update_once
    tmp=$(mktemp -d); trap 'rm -rf "$tmp"' EXIT
    # the newest 22.3.6 that the mirror offers (a security update has another suffix)
    v=$(apt-cache madison mesa-vulkan-drivers | awk '{print $3}' | grep '^22\.3\.6' | head -n 1)
    [ -n "$v" ] || die "mesa-vulkan-drivers 22.3.6 is not in this machine's package lists"
    say "unpacking mesa-vulkan-drivers $v beside it"
    chmod 755 "$tmp"
    (cd "$tmp" && apt-get -qq download "mesa-vulkan-drivers=$v" 2>/dev/null && dpkg-deb -x ./*.deb root) || die "could not download mesa-vulkan-drivers $v"
    mkdir -p "$floor"
    cp "$tmp"/root/usr/lib/*/libvulkan_lvp.so "$floor/libvulkan_lvp.so"
    api=$(sed -n 's/.*"api_version": *"\([^"]*\)".*/\1/p' "$tmp"/root/usr/share/vulkan/icd.d/lvp_icd.*.json)
    # relative to the file itself, so that the folder can be moved; write beside, then rename: a broken-off run leaves no half-made driver
    printf '{"file_format_version":"1.0.0","ICD":{"library_path":"%s","api_version":"%s"}}\n' ./libvulkan_lvp.so "${api:-1.3.230}" > "$floor/lvp_icd.json.new"
    mv "$floor/lvp_icd.json.new" "$floor/lvp_icd.json"
  fi
  say "floor driver: $floor/lvp_icd.json"
fi

command -v cargo >/dev/null 2>&1 || die "no cargo on PATH: install the stable Rust toolchain (1.88 or newer) with rustup, then run this again"
say "done"
