#!/usr/bin/env bash
# What skylit does on a GPU, tried where there is one: builds a kit here, prints the one command that runs it there, and turns what comes back into a page.
#
#   ./scripts/gpu.sh                     builds target/gpu-kit and target/gpu-kit.tar.gz, and prints the command
#   ./scripts/gpu.sh report FOLDER       turns the folder that the command wrote (or its results.tar.gz) into docs/results/gpu.md
#
# The other machine needs Linux on x86-64 with glibc 2.35 or newer (Ubuntu 22.04, Debian 12), bash, coreutils and a Vulkan driver: no network, no compiler, no
# Python. What containers often lack is in the kit: the Vulkan loader, the validation layer, the libraries that NVIDIA's driver asks for; and where
# the driver's library is there but not the file that names it to the loader, the kit writes one. It takes nine minutes at most (scripts/gpu/run.sh).
#
# SKYLIT_KIT  folder of the kit, target/gpu-kit unless given
set -euo pipefail
cd "$(dirname "$0")/.."

say() { printf 'gpu: %s\n' "$*"; }
die() { printf 'gpu: error: %s\n' "$*" >&2; exit 1; }

if [ "${1:-}" = report ]; then
  [ -n "${2:-}" ] || die "which folder? ./scripts/gpu.sh report FOLDER"
  command -v python3 >/dev/null 2>&1 || die "the report is written by Python 3, which is not here"
  exec python3 scripts/gpu/report.py "$2" "${3:-docs/results/gpu.md}"
fi
[ $# = 0 ] || die "expected nothing, or: report FOLDER"
[ "$(uname -sm)" = "Linux x86_64" ] || die "the kit is for Linux on x86-64, and is built there"

kit=${SKYLIT_KIT:-target/gpu-kit}
say "building the program and the device tests"
cargo build --release --locked
target=${CARGO_TARGET_DIR:-target}
# the tests with their debug assertions, in the profile of every day
tests=(tracer ao path realtime)
binaries=$(cargo test --no-run --locked --message-format json "${tests[@]/#/--test=}" | sed -n 's/.*"name":"\([a-z_]*\)".*"executable":"\([^"]*\)".*/\1 \2/p')

rm -rf "$kit" "$kit.tar.gz"
mkdir -p "$kit/bin" "$kit/lib/loader" "$kit/lib/driver" "$kit/lib/gcc" "$kit/layer" "$kit/scenes"
strip -o "$kit/bin/skylit" "$target/release/skylit"
for name in "${tests[@]}"; do
  file=$(awk -v name="$name" '$1 == name {print $2}' <<< "$binaries")
  [ -n "$file" ] || die "cargo did not say where the tests '$name' are"
  strip -o "$kit/bin/tests-$name" "$file"
done
cp scenes/parade.glb scenes/leaves.glb scenes/courtyard.* scenes/courtyard_*.png "$kit/scenes/"
cp scripts/gpu/run.sh "$kit/"
# modules of the tests
for name in "${tests[@]}"; do
  "$kit/bin/tests-$name" --list 2>/dev/null | sed -n 's/^\([a-z_]*\)::.*: test$/\1/p' | sort -u | sed "s/^/$name /"
done > "$kit/tests.txt"

# carry FOLDER LIBRARY...: copies libraries of this machine, and what they need but for glibc's own; what is not here is left out
carry() {
  local folder=$1 name path
  shift
  for name in "$@"; do
    path=$(ldconfig -p | awk -v name="$name" '$1 == name && /x86-64/ && !n++ {print $NF}')
    if [ -z "$path" ]; then say "no $name here: the kit goes without"; continue; fi
    cp -L "$path" "$folder/$name"
    ldd "$path" | awk '$2 == "=>" && $3 ~ /^\// {print $1, $3}' | while read -r need file; do
      case $need in libc.so.* | libm.so.* | libdl.so.* | libpthread.so.* | librt.so.* | ld-linux*) ;; *) [ -e "$folder/$need" ] || cp -L "$file" "$folder/$need" ;; esac
    done
  done
}
PATH=$PATH:/sbin:/usr/sbin
carry "$kit/lib/loader" libvulkan.so.1
carry "$kit/lib/gcc" libgcc_s.so.1
# NVIDIA's libGLX_nvidia and libEGL_nvidia ask for these. With the first four alone driver 580 gave no entry point; with all of libglvnd it did.
carry "$kit/lib/driver" libX11.so.6 libXext.so.6 libxcb.so.1 libGLdispatch.so.0 libEGL.so.1 libGLX.so.0 libGL.so.1 libOpenGL.so.0 libGLESv2.so.2
layer=$(ldconfig -p | awk '$1 == "libVkLayer_khronos_validation.so" && !n++ {print $NF}')
if [ -n "$layer" ] && [ -f /usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json ]; then
  strip -o "$kit/layer/libVkLayer_khronos_validation.so" "$layer"
  sed 's|"library_path": *"[^"]*"|"library_path": "./libVkLayer_khronos_validation.so"|' \
    /usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json > "$kit/layer/VkLayer_khronos_validation.json"
else
  say "no validation layer here: the kit goes without"
fi

glibc=$(objdump -T "$kit"/bin/* "$kit"/lib/*/* "$kit"/layer/*.so 2>/dev/null | grep -o 'GLIBC_[0-9.]*' | sort -Vu | tail -n 1)
{
  printf 'skylit %s\n' "$("$kit/bin/skylit" --version | awk 'NR == 1 {print $2}')"
  printf 'commit %s%s\n' "$(git rev-parse --short=12 HEAD 2>/dev/null || echo unknown)" "$(git diff --quiet HEAD 2>/dev/null || echo ' and changes')"
  printf 'needs glibc %s or newer\n' "${glibc#GLIBC_}"
} > "$kit/VERSION"
tar -C "$(dirname "$kit")" -cf - "$(basename "$kit")" | gzip -9 > "$kit.tar.gz"
size=$(du -m "$kit.tar.gz" | cut -f1)
cat "$kit/VERSION"
say "$kit.tar.gz has $size MB; unpacked $(du -sm "$kit" | cut -f1)"
[ "$size" -le 60 ] || die "the kit is to stay under 60 MB"
say "on the machine with the GPU, beside the file:"
printf '\n    tar xzf %s && ./%s/run.sh results\n\n' "$(basename "$kit").tar.gz" "$(basename "$kit")"
say "then bring the folder results (or results.tar.gz, which holds it) here, and: ./scripts/gpu.sh report results"
