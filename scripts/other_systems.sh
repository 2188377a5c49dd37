#!/usr/bin/env bash
# Has the compiler check the library and the program for systems other than Linux. Nothing is linked, so neither their SDK nor their linker is needed.
#
#   ./scripts/other_systems.sh             Windows (MSVC) and macOS, from any system
#   ./scripts/other_systems.sh native      this system: what CI runs on Windows and macOS, with shaderc from source
#
# C and C++ that crates compile (meshoptimizer) is left out where it is for another system: their compilers are replaced by a command that does
# nothing but leave empty files. `cargo check` reads no objects. Shaders are not compiled either (live-shaders): they are the same on all systems. So this finds Rust that does not
# compile there, and says nothing of what a linker or a driver would say.
set -euo pipefail
cd "$(dirname "$0")/.."
say() { printf 'other systems: %s\n' "$*"; }

# check NAME ARGUMENT...: the library alone, then the program with all that it has by default
check() {
  local name=$1
  shift
  cargo check --locked --lib --no-default-features "$@"
  cargo check --locked --lib --bin skylit "$@"
  say "$name: library and program compile"
}

if [ "${1:-}" = native ]; then
  check "this system" --features build-shaderc
  exit
fi

# the archiver of MSVC has to leave a file
nothing=$(mktemp)
trap 'rm -f "$nothing"' EXIT
cat > "$nothing" <<'STUB'
#!/bin/sh
for word; do case $word in [-/]out:*|[-/]OUT:*) : > "${word#?????}" ;; esac; done
STUB
chmod +x "$nothing"
for target in x86_64-pc-windows-msvc aarch64-apple-darwin; do
  if command -v rustup >/dev/null; then rustup target add "$target" >/dev/null; fi
  variable=${target//-/_}
  env "CC_$variable=$nothing" "CXX_$variable=$nothing" "AR_$variable=$nothing" "RANLIB_$variable=$nothing" \
    bash -c "$(declare -f check say)"'; set -euo pipefail; check "$@"' check "$target" --target "$target" --features live-shaders
done
