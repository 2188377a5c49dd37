#!/usr/bin/env bash
# Runs skylit on this machine's GPU and writes everything into one folder. Part of the kit that scripts/gpu.sh makes; needs nothing but what lies beside it
# and a Vulkan driver. A step that fails, or that takes too long, is noted and does not stop the others. Ends with 0 if every step did what it should.
#
#   ./run.sh [--quick] [--seconds N] [FOLDER]
#
#   FOLDER        where to write, `results` unless given; FOLDER.tar.gz holds it besides
#   --quick       little of everything; chosen by itself where the only device is a CPU
#   --seconds N   stop after this time in all, 520 unless given: steps that no time is left for are left out
set -uo pipefail
kit=$(cd "$(dirname "$0")" && pwd)
quick='' total=520 out=results
while [ $# -gt 0 ]; do
  case $1 in
    --quick) quick=1 ;;
    --seconds) shift && total=${1:?seconds} ;;
    -*) echo "run.sh: error: no option $1; there are --quick and --seconds" >&2 && exit 64 ;;
    *) out=$1 ;;
  esac
  shift
done
mkdir -p "$out" && out=$(cd "$out" && pwd) || exit 4
cache=$(mktemp -d) || exit 4
trap 'rm -rf "$cache"' EXIT
# nothing of an earlier run: the first launch compiles, and says how long that takes
export XDG_CACHE_HOME=$cache RUST_BACKTRACE=1
skylit=$kit/bin/skylit
# the tests run it, too
export SKYLIT_PROGRAM=$skylit
cd "$kit" || exit 4
PATH=$PATH:/sbin:/usr/sbin

say() { printf 'run: %s\n' "$*"; }

# --- the library of GCC, the loader and the driver -----------------------------------------------------------------------
libraries=${LD_LIBRARY_PATH:-}
add_library_path() { libraries=$1${libraries:+:$libraries}; export LD_LIBRARY_PATH=$libraries; }
log=$out/driver.log
: > "$log"
if ! timeout 20 "$skylit" --version >> "$log" 2>&1; then
  add_library_path "$kit/lib/gcc"
  if ! timeout 20 "$skylit" --version >> "$log" 2>&1; then
    say "the program does not start here; $(tail -n 1 "$kit/VERSION"):"
    cat "$log"
    exit 2
  fi
fi

# look WHAT: asks for devices with the environment as it is; succeeds where one is a GPU
look() {
  timeout -k 5 30 "$skylit" doctor --json > "$cache/doctor.json" 2>> "$log"
  local status=$?
  printf '%s: exit code %s, %s\n' "$1" "$status" "$(grep -o '"kind":"[a-z_]*"' "$cache/doctor.json" | tr '\n' ' ')" | tee -a "$log"
  grep -qE '"kind":"(discrete|integrated|virtual)' "$cache/doctor.json"
}
# with which libraries and which file there was a device, if none is a GPU
any='' libraries_of_any='' manifest_of_any=''
remember() {
  if [ -z "$any" ] && grep -q '"kind":' "$cache/doctor.json"; then any=1 libraries_of_any=$libraries manifest_of_any=${VK_DRIVER_FILES:-}; fi
}
# the files that name NVIDIA's driver to the loader, then its libraries
manifests() {
  find /etc/vulkan /usr/share/vulkan /usr/local/share/vulkan /usr/local/nvidia /usr/lib/nvidia /opt /run/opengl-driver -maxdepth 5 -name 'nvidia*icd*.json' 2>/dev/null
}
driver_libraries() {
  local name
  for name in libGLX_nvidia.so.0 libEGL_nvidia.so.0; do
    { ldconfig -p 2>/dev/null | awk -v name="$name" '$1 == name && /x86-64/ {print $NF}'
      find /usr/lib /usr/lib64 /usr/local /opt /run/opengl-driver -maxdepth 4 -name "$name" 2>/dev/null; } | awk '!seen[$0]++'
  done
}
find_gpu() {
  look "as the machine is" && return 0
  remember
  local with manifest file
  for with in loader driver; do
    add_library_path "$kit/lib/$with"
    unset VK_DRIVER_FILES VK_ICD_FILENAMES
    look "with the kit's lib/$with" && return 0
    remember
    while read -r manifest; do
      export VK_DRIVER_FILES=$manifest VK_ICD_FILENAMES=$manifest
      look "with $manifest" && return 0
      remember
    done < <(manifests)
    while read -r file; do
      printf '{"file_format_version":"1.0.0","ICD":{"library_path":"%s","api_version":"1.3.0"}}\n' "$file" > "$out/${file##*/}.json"
      export VK_DRIVER_FILES=$out/${file##*/}.json VK_ICD_FILENAMES=$out/${file##*/}.json
      look "with a file of ours that names $file" && return 0
      remember
    done < <(driver_libraries)
  done
  return 1
}
start=$SECONDS
say "looking for a GPU"
if find_gpu; then gpu=1; else gpu=''; fi
if [ -z "$gpu" ]; then
  unset VK_DRIVER_FILES VK_ICD_FILENAMES
  if [ -z "$any" ]; then
    say "no Vulkan device here, with or without the kit's loader; $log has each try"
    printf 'driver\t2\t%s\t30\tA Vulkan device\n' "$((SECONDS - start))" > "$out/steps.tsv"
    exit 2
  fi
  export LD_LIBRARY_PATH=$libraries_of_any
  if [ -n "$manifest_of_any" ]; then export VK_DRIVER_FILES=$manifest_of_any VK_ICD_FILENAMES=$manifest_of_any; fi
  say "no GPU here: a CPU instead, and little of everything"
  quick=1
fi

# --- the validation layer: the machine's, or the kit's ---------------------------------------------------------------------
layer=no
validates() { timeout -k 5 60 "$skylit" render builtin:plane --size 16x16 --spp 1 --validation --quiet -o "$cache/plane.png" >> "$log" 2>&1; }
if validates; then layer="the machine's"; elif [ -d "$kit/layer" ]; then
  export VK_ADD_LAYER_PATH=$kit/layer VK_LAYER_PATH=$kit/layer
  if validates; then layer="the kit's"; fi
fi
if [ "$layer" = no ]; then
  unset VK_ADD_LAYER_PATH VK_LAYER_PATH
  # read by the tests, which open their devices with the layer
  export SKYLIT_VALIDATION=off
fi
say "validation layer: $layer"
# the tracers of the device, not those that a test machine expects
unset SKYLIT_EXPECT_TRACERS SKYLIT_REQUIRE_DRIVER
tracers=()
for t in pipeline query compute; do
  if timeout -k 5 60 "$skylit" render builtin:plane --size 16x16 --spp 1 --tracer $t --quiet -o "$cache/plane.png" >> "$log" 2>&1; then tracers+=("$t"); fi
done
say "tracers: ${tracers[*]:-none}"
{
  cat "$kit/VERSION"
  printf 'quick %s\nvalidation layer %s\ntracers %s\n' "${quick:-no}" "$layer" "${tracers[*]:-none}"
  printf 'date %s\nsystem %s\n' "$(date -u +%Y-%m-%d)" "$(uname -sm)"
  printf 'cpu %s, %s threads\n' "$(sed -n 's/^model name[^:]*: //p' /proc/cpuinfo | head -n 1)" "$(nproc)"
  printf 'glibc %s\n' "$(ldd --version 2>/dev/null | head -n 1)"
} > "$out/about.txt"
if command -v nvidia-smi >/dev/null 2>&1; then timeout 20 nvidia-smi > "$out/nvidia-smi.txt" 2>&1; fi

# --- steps -----------------------------------------------------------------------------------------------------------------
: > "$out/steps.tsv"
# step NAME LIMIT TITLE COMMAND...: runs it with that many seconds at most; its output goes to NAME.log
step() {
  local name=$1 limit=$2 title=$3 status left began=$SECONDS
  shift 3
  # what packing takes is kept back
  left=$((total - (SECONDS - start) - 5))
  if [ $left -lt 5 ]; then
    printf '%s\tleft out\t0\t%s\t%s\n' "$name" "$limit" "$title" >> "$out/steps.tsv"
    return 0
  fi
  if [ "$limit" -gt $left ]; then limit=$left; fi
  timeout -k 5 "$limit" "$@" > "$out/$name.log" 2>&1
  status=$?
  printf '%s\t%s\t%s\t%s\t%s\n' "$name" $status $((SECONDS - began)) "$limit" "$title" >> "$out/steps.tsv"
  say "$title: $([ $status = 0 ] && echo done || echo "exit code $status") after $((SECONDS - began)) s"
  if [ $status != 0 ]; then tail -n 2 "$out/$name.log"; fi
  return 0
}
# check NAME LIMIT TITLE COMMAND...: a step that is not timed: one beside others where there are processors for it. `wait` before one that is.
beside=$(($(nproc) / 2))
check() {
  while [ "$(jobs -rp | wc -l)" -ge $((beside > 0 ? beside : 1)) ]; do wait -n; done
  step "$@" &
}
pick() { if [ -n "$quick" ]; then echo "$1"; else echo "$2"; fi; }

# images NAME SCENE OPTIONS...: one by each tracer, and how far each is from the first: 0.01 leaves room for rays at edges
images() {
  local name=$1 scene=$2 first='' t
  shift 2
  for t in "${tracers[@]}"; do
    "$skylit" render "$scene" --tracer "$t" "$@" -o "$cache/$name-$t.exr" -o "$out/$name-$t.png" --json > "$out/$name-$t.json" || return 1
    if [ -z "$first" ]; then first=$t; else
      echo "$name: $first and $t"
      "$skylit" diff "$cache/$name-$first.exr" "$cache/$name-$t.exr" --max-rmse 0.01 --json > "$out/diff-$name-$t.json" || return 1
    fi
  done
}
export -f images
export skylit out cache
# arrays are not exported
tracer_list="${tracers[*]}"
export tracer_list
every_tracer=(bash -c 'read -ra tracers <<< "$tracer_list"; images "$@"' bash)

step doctor 30 "What the device has" "$skylit" doctor
"$skylit" doctor --json > "$out/doctor.json" 2>> "$log"
step cold 60 "First image: pipelines are compiled" "$skylit" render builtin:cornell-box --size 320x180 --spp 1 --json -o "$cache/cold.png"
step warm 60 "The same again: pipelines come from the cache" "$skylit" render builtin:cornell-box --size 320x180 --spp 1 --json -o "$cache/cold.png"

size=$(pick 160x90 320x180)
spp=$(pick 8 64)
for scene in cornell-box stairs leaf-cards grid:4; do
  check "ao-${scene%:*}" 40 "Ambient occlusion of $scene, every tracer" \
    "${every_tracer[@]}" "ao-${scene%:*}" "builtin:$scene" --size "$size" --spp "$spp"
done
check path-cornell-box 60 "Path tracing of cornell-box, every tracer" \
  "${every_tracer[@]}" path-cornell-box builtin:cornell-box --integrator path --size "$size" --spp "$(pick 16 256)"

# rays of the oracle's sets, per scene
SKYLIT_PARITY_RAYS=$(pick 60000 1000000)
export SKYLIT_PARITY_RAYS
for scene in cornell alpha_masks instances spheres; do
  check "parity-$scene" "$(pick 60 45)" "Parity with the double-precision oracle: $scene" "$kit/bin/tests-tracer" --exact "parity::gpu_parity_$scene" --nocapture
done
check leaks 60 "Watertightness: rays at edges and corners" "$kit/bin/tests-tracer" --exact parity::gpu_nothing_leaks --nocapture

if [ "$layer" != no ]; then
  check validate-ao 40 "Validation: ambient occlusion" "$skylit" render builtin:leaf-cards --size 160x90 --spp 4 --aov all --validation --json -o "$cache/validated.exr"
  check validate-path 60 "Validation: path tracing" "$skylit" render builtin:cornell-glass-sphere --integrator path --size 160x90 --spp 4 --validation --json -o "$cache/validated.exr"
  check validate-frames 60 "Validation: frames of ambient occlusion" "$skylit" render "$kit/scenes/parade.glb" --preset balanced --animate --frames 0..10 --size 320x180 --validation --json -o "$cache/validated.apng"
  check validate-light 60 "Validation: frames of light" "$skylit" render "$kit/scenes/parade.glb" --integrator path --preset balanced --animate --frames 0..10 --size 320x180 --validation --json -o "$cache/validated-light.apng"
fi

# a closed form at a time: one that is slow takes no time of another
closed=$(pick "gpu_ao_falloff_and_radius_in_grooves gpu_ao_parallel_planes" \
  "gpu_ao_v_grooves gpu_ao_falloff_and_radius_in_grooves gpu_ao_sphere_over_plane gpu_ao_sphere_with_falloff gpu_ao_parallel_planes")
for test in $closed; do
  check "${test#gpu_}" "$(pick 60 40)" "Closed form: ${test#gpu_ao_}" "$kit/bin/tests-ao" --exact "closed_forms::$test" --nocapture
done

check furnaces "$(pick 5 60)" "Closed forms of path tracing: furnaces" "$kit/bin/tests-path" furnace:: --test-threads=1
for t in "${tracers[@]}"; do
  check "stress-$t" "$(pick 60 120)" "Numerical stability: skylit stress, $t" "$skylit" stress --tracer "$t" --json
done
# the tests of the device, a module at a time: what of them a CPU has no time for, a GPU has
if [ -z "$quick" ]; then
  while read -r binary module; do
    check "tests-$binary-$module" 120 "Tests: $binary, $module" "$kit/bin/tests-$binary" "$module::" --test-threads=2
  done < "$kit/tests.txt"
fi
wait

# the presets; `still` and `moving` cameras, and the error that each leaves
read -ra scenes <<< "$(pick "builtin:stairs" "builtin:stairs builtin:terrain:1000000")"
step bench-ao 80 "Presets in real time" "$skylit" bench ao "${scenes[@]}" --parts still,moving --size "$(pick 160x90 1920x1080)" --frames "$(pick 8 64)" \
  --reference-rays "$(pick 16 512)" --time-limit "$(pick 60 60)" --json="$out/bench-ao.json"
read -ra scenes <<< "$(pick "builtin:stairs" "builtin:cornell-box builtin:stairs builtin:terrain:1000000")"
# brute force and the readable kernels are for comparison on a CPU
read -ra more <<< "$(pick "--quick --rays 14400 --repeats 2" "--repeats 5")"
step bench-rays 60 "Rays a second" "$skylit" bench rays "${scenes[@]}" "${more[@]}" --check --peers none --time-limit "$(pick 30 45)" --json="$out/bench-rays.json"
# what the builder on the device takes, and the same hits as those of the hierarchies that the host builds
read -ra scenes <<< "$(pick "builtin:stairs" "builtin:terrain:1000000 builtin:city:1000000")"
read -ra more <<< "$(pick "--quick --rays 14400 --repeats 2" "--repeats 5")"
step bench-build-device 60 "Hierarchies built on the device" "$skylit" bench rays "${scenes[@]}" "${more[@]}" --kernels wide,pipeline --build device --check --peers none \
  --time-limit "$(pick 30 45)" --json="$out/bench-build-device.json"
step bench-build-mesh 60 "A mesh of Larsen's size, built on the device" "$skylit" bench frames --integrator ao --parts structures --tracer compute --build device \
  --repeats "$(pick 1 3)" --peers none --json="$out/bench-build-mesh.json"
step bench-build-host 60 "The same, built on the host" "$skylit" bench rays "${scenes[@]}" "${more[@]}" --kernels wide --build default --peers none \
  --time-limit "$(pick 30 45)" --json="$out/bench-build-host.json"
read -ra scenes <<< "$(pick "cornell" "cornell sphere-diffuse")"
read -ra more <<< "$(pick "--quick --strategies mis --reference-seconds 3" "--strategies mis,bsdf --seconds 1 --repeats 3 --reference-seconds 10")"
step bench-path 60 "Path tracing: error against time" "$skylit" bench path "${scenes[@]}" "${more[@]}" --peers none --time-limit "$(pick 30 40)" --json="$out/bench-path.json"

# one scene in a large image; errors of other scenes and motions in small ones, where a reference of many paths takes little
step bench-frames 80 "Path tracing in real time" "$skylit" bench frames builtin:cornell-box --peers none --parts still,moving --size "$(pick 64x36 1920x1080)" \
  --frames "$(pick 8 32)" --reference-paths "$(pick 16 256)" --time-limit "$(pick 30 70)" --json="$out/bench-frames.json"
step bench-frames-scenes 80 "Path tracing in real time: mirror, parade" "$skylit" bench frames builtin:cornell-mirror builtin:parade --peers none --presets fast,balanced \
  --parts still,moving,animation --size "$(pick 64x36 640x360)" --frames "$(pick 8 32)" --reference-paths "$(pick 16 1024)" --time-limit "$(pick 30 60)" \
  --json="$out/bench-frames-scenes.json"

# images to look at
step image-courtyard 30 "Image: path tracing of the courtyard" "$skylit" render "$kit/scenes/courtyard.gltf" --integrator path --environment 1,1.1,1.3 --exposure -2 \
  --size "$size" --spp "$(pick 8 256)" --json -o "$out/image-courtyard.png"
for preset in fast balanced quality; do
  step "image-path-$preset" 30 "Image: path tracing, preset $preset" "$skylit" render "$kit/scenes/courtyard.gltf" --integrator path --environment 1,1.1,1.3 --exposure -2 --preset $preset \
    --warm-up 15 --size "$size" --json -o "$out/image-path-$preset.png"
done
for preset in larsen fast balanced quality; do
  step "image-$preset" 30 "Image: preset $preset" "$skylit" render builtin:stairs --preset $preset --size "$size" --json -o "$out/image-$preset.png"
done
step image-parade 40 "Animation: preset balanced" "$skylit" render "$kit/scenes/parade.glb" --preset balanced --animate --frames "0..$(pick 6 30)" --size "$size" --json -o "$out/image-parade.apng"

tar -C "$(dirname "$out")" -czf "$out.tar.gz" "$(basename "$out")"
say "$((SECONDS - start)) s; $(awk -F '\t' '$2 == "0"' "$out/steps.tsv" | wc -l) of $(wc -l < "$out/steps.tsv") steps did what they should: $out, and in one file $out.tar.gz"
! grep -qv $'^[^\t]*\t0\t' "$out/steps.tsv"
