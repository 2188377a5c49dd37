#!/usr/bin/env bash
# Builds skylit in a clean Debian 12 or 13 or Ubuntu 24.04, as root: installs a compiler, Rust and shaderc, then the program.
#
#   ./scripts/container/build.sh FOLDER      where the program goes, such as /usr/local/bin
#
# The first stage of the Dockerfile runs it. The program has the commands that need no window: render, verify, diff, export, rays, scenes, doctor.
# SKYLIT_PROFILE  profile to build with [default: release]
set -euo pipefail
cd "$(dirname "$0")/../.."
folder=${1:?give the folder that the program goes to}
profile=${SKYLIT_PROFILE:-release}
say() { printf 'container: %s\n' "$*"; }

export DEBIAN_FRONTEND=noninteractive
say "installing a compiler and shaderc"
apt-get -qq update
# what shaderc-libraries links: shaderc with its static library, glslang and SPIRV-Tools
apt-get -qq install -y --no-install-recommends ca-certificates curl g++ pkg-config libshaderc-dev glslang-dev spirv-tools > /dev/null
# .cargo/config.toml knows one architecture
export SHADERC_LIB_DIR=${SHADERC_LIB_DIR:-/usr/lib/$(uname -m)-linux-gnu}

if ! command -v cargo > /dev/null; then
  say "installing Rust"
  curl --proto '=https' --tlsv1.2 -sSf https://sh.rustup.rs | sh -s -- -y -q --profile minimal --default-toolchain stable
  # shellcheck disable=SC1091  # rustup has just written it
  . "$HOME/.cargo/env"
fi

say "compiling (profile $profile)"
cargo build --locked --profile "$profile" --no-default-features --features cli,verify --bin skylit
case $profile in dev) built=debug ;; *) built=$profile ;; esac
install -D -m 755 "${CARGO_TARGET_DIR:-target}/$built/skylit" "$folder/skylit"
# of 124 MB, 89 are for debuggers
strip --strip-unneeded "$folder/skylit"
say "$("$folder/skylit" -V) in $folder"
