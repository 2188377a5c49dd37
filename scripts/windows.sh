#!/usr/bin/env bash
# Builds the program for Windows on Linux, and tries it under Wine.
#
#   ./scripts/windows.sh          builds target/x86_64-pc-windows-gnu/release/skylit.exe (SKYLIT_PROFILE=dev: .../debug/skylit.exe)
#   ./scripts/windows.sh check    then renders with it under Wine, by the Vulkan driver of this machine, beside the program of this
#                                 system: images have the same bytes. Opens the viewer's window on a display of its own, too.
#
# On Debian it installs MinGW-w64 and, for `check`, Wine and Xvfb. The program needs no DLL but those of Windows and of the graphics driver.
# SKYLIT_PROFILE  profile of the build [default: release]
# SKYLIT_NATIVE   program of this system that images are compared with [default: it is built]
set -euo pipefail
cd "$(dirname "$0")/.."
target=x86_64-pc-windows-gnu
profile=${SKYLIT_PROFILE:-release}
folder=$profile
if [ "$profile" = dev ]; then folder=debug; fi
built=$(realpath -m "${CARGO_TARGET_DIR:-target}")
program=$built/$target/$folder/skylit.exe
say() { printf 'windows: %s\n' "$*"; }
die() { printf 'windows: error: %s\n' "$*" >&2; exit 1; }

# install COMMAND PACKAGE...: by apt, unless the command is there
install() {
  local command=$1
  shift
  if command -v "$command" >/dev/null || [ -x "/usr/lib/wine/$command" ]; then return; fi
  command -v apt-get >/dev/null || die "$command is missing, and there is no apt-get to install $*"
  say "installing $*"
  apt-get install -y --no-install-recommends "$@" >/dev/null
}

build() {
  ./scripts/setup.sh
  install x86_64-w64-mingw32-g++ gcc-mingw-w64-x86-64 g++-mingw-w64-x86-64
  rustup target add "$target"
  # the library of C++ goes into the program, since few machines have that of MinGW: where the linker looks first it is static only
  local static=$built/$target/static
  mkdir -p "$static"
  cp "$(x86_64-w64-mingw32-g++ -print-file-name=libstdc++.a)" "$static"
  cargo rustc --locked --profile "$profile" --target "$target" --bin skylit -- -L "native=$static"
  local dlls
  dlls=$(x86_64-w64-mingw32-objdump -p "$program" | sed -n 's/^\tDLL Name: //p' | grep -i -E '^lib|stdc|gcc|pthread' || true)
  [ -z "$dlls" ] || die "the program needs $dlls, which Windows does not have"
  say "$program"
}

# Wine before version 9 lacks this library of Windows, from which the Rust standard library gets random numbers
add_random_numbers() {
  [ ! -e "$wine_folder/bcryptprimitives.dll" ] || return 0
  cat > "$wine_folder/random.c" <<'C'
#include <windows.h>
#include <ntsecapi.h>
__declspec(dllexport) BOOL WINAPI ProcessPrng(PBYTE bytes, SIZE_T count) { return RtlGenRandom(bytes, (ULONG)count); }
C
  x86_64-w64-mingw32-gcc -shared -o "$wine_folder/bcryptprimitives.dll" "$wine_folder/random.c" -ladvapi32
}

under_wine() { timeout 300 "$wine" "$wine_folder/skylit.exe" "$@"; }

# same NAME ARGUMENT...: both programs make the same image, of vectors of the width that Wine lets the driver have
same() {
  local name=$1
  shift
  under_wine "$@" --size 160x90 --spp 16 --quiet -o "$wine_folder/$name-windows.exr"
  LP_NATIVE_VECTOR_WIDTH=256 "$native" "$@" --size 160x90 --spp 16 --quiet -o "$wine_folder/$name.exr"
  "$native" diff "$wine_folder/$name-windows.exr" "$wine_folder/$name.exr" --json > "$wine_folder/$name.json"
  cmp "$wine_folder/$name-windows.exr" "$wine_folder/$name.exr" || die "$name: other bytes"
  say "$name: the same bytes"
}

# refused CODE ARGUMENT...: the program ends with this code
refused() {
  local code=$1 status=0
  shift
  under_wine "$@" 2> "$wine_folder/error" || status=$?
  [ "$status" = "$code" ] || die "$*: exit code $status, not $code: $(cat "$wine_folder/error")"
  say "$*: exit code $code"
}

check() {
  install wine64 wine64 libwine
  install Xvfb xvfb
  install xdotool xdotool
  wine=$(command -v wine64 || echo /usr/lib/wine/wine64)
  native=${SKYLIT_NATIVE:-$built/$folder/skylit}
  [ -n "${SKYLIT_NATIVE:-}" ] || cargo build --locked --profile "$profile" --bin skylit
  wine_folder=$(mktemp -d)
  display=:$((RANDOM % 900 + 100))
  Xvfb "$display" -screen 0 1280x800x24 >/dev/null 2>&1 &
  local server=$!
  # shellcheck disable=SC2064  # now
  trap "kill $server 2>/dev/null || true; WINEPREFIX=$wine_folder/prefix timeout 20 /usr/lib/wine/wineserver64 -k 2>/dev/null || true; rm -rf $wine_folder" EXIT
  # Wine finds Vulkan by the driver of its display
  export DISPLAY=$display WINEPREFIX=$wine_folder/prefix WINEDEBUG=-all LP_NATIVE_VECTOR_WIDTH=256
  sleep 1
  cp "$program" "$wine_folder/skylit.exe"
  add_random_numbers
  say "$(under_wine --version 2>/dev/null | head -n 1), $("$wine" --version 2>/dev/null)"
  under_wine doctor | grep -q '^ready' || die "doctor is not content"

  same stairs render builtin:stairs
  same cornell-box render builtin:cornell-box --integrator path
  # a sky would differ in last digits: the functions of C libraries that make it do
  same file render tests/frames/corner.obj --integrator path --environment 1,1,1
  refused 3 render no-such-file.glb -o "$wine_folder/a.png"
  refused 64 render builtin:plane --size 0x0 -o "$wine_folder/a.png"
  refused 4 render builtin:plane --size 16x16 --spp 1 -o 'Z:\no-such-folder\a.png'
  under_wine export builtin:stairs "$wine_folder/stairs.glb" --quiet
  under_wine bake "$wine_folder/stairs.glb" -o "$wine_folder/baked.glb" --size 64 --spp 4 --quiet
  say "export and bake: $(stat -c %s "$wine_folder/baked.glb") bytes"

  # a window whose title names the scene
  under_wine view builtin:stairs --size 640x400 > "$wine_folder/view.log" 2>&1 &
  local waited=0
  until xdotool search --name 'builtin:stairs - skylit' >/dev/null 2>&1; do
    sleep 1
    waited=$((waited + 1))
    [ "$waited" -lt 120 ] || die "no window: $(cat "$wine_folder/view.log")"
  done
  say "the viewer's window is open"
  xdotool search --name 'builtin:stairs - skylit' windowclose >/dev/null 2>&1 || true
  say "all as it should be"
}

build
if [ "${1:-}" = check ]; then check; fi
