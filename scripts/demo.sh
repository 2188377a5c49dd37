#!/usr/bin/env bash
# Sets up, builds, and renders the ambient occlusion of built-in scenes with each of the three tracers; prints how far apart
# the tracers' images are, and where the images lie; then a short animation in real time, and a report of ambient occlusion against
# the reference in an arcaded courtyard, whose address is the last line.
#
#   ./scripts/demo.sh [SPP]         samples per pixel, 64 unless given
#
# SKYLIT_PROFILE   profile to build with, release unless given
# SKYLIT_FEATURES  cargo features to build with besides
# SKYLIT_DEMO_SIZE  size of images, 640x360 unless given
set -euo pipefail
cd "$(dirname "$0")/.."
spp=${1:-${SKYLIT_DEMO_SPP:-64}}
out=${SKYLIT_DEMO_DIR:-target/demo}
size=${SKYLIT_DEMO_SIZE:-640x360}
scenes=(cornell-box stairs leaf-cards)
tracers=(pipeline query compute)

say() { printf 'demo: %s\n' "$*"; }

./scripts/setup.sh
say "building"
profile=${SKYLIT_PROFILE:-release}
cargo build --profile "$profile" --locked ${SKYLIT_FEATURES:+--features "$SKYLIT_FEATURES"}
# cargo's folder of the profile dev
skylit=${CARGO_TARGET_DIR:-target}/${profile/#dev/debug}/skylit
mkdir -p "$out"
"$skylit" doctor

for scene in "${scenes[@]}"; do
  for tracer in "${tracers[@]}"; do
    say "$scene, tracer $tracer"
    "$skylit" render "builtin:$scene" --no-config --tracer "$tracer" --spp "$spp" --size "$size" \
      -o "$out/$scene-$tracer.exr" -o "$out/$scene-$tracer.png"
  done
done

say "a scene in motion, frame after frame"
"$skylit" render scenes/parade.glb --no-config --preset balanced --animate --frames 0..30 --size 480x270 -o "$out/parade.apng"

report=$out/report.md
{
  echo "# skylit: ambient occlusion by three tracers"
  echo
  "$skylit" doctor | tail -n 1
  for scene in "${scenes[@]}"; do
    printf '\n## %s, %s, %s samples per pixel\n\n' "$scene" "$size" "$spp"
    printf '| %s | %s | %s |\n|---|---|---|\n' "${tracers[@]}"
    printf '|'
    for tracer in "${tracers[@]}"; do printf ' ![%s](%s-%s.png) |' "$tracer" "$scene" "$tracer"; done
    printf '\n\nDifferences of the ambient visibility (channel Y, 0 to 1):\n\n'
    for pair in "pipeline query" "pipeline compute" "query compute"; do
      a=${pair% *} b=${pair#* }
      # an assignment of its own: inside printf's arguments a failure would go unnoticed
      numbers=$("$skylit" diff "$out/$scene-$a.exr" "$out/$scene-$b.exr" --max-rmse 0.005 | sed -n 's/^Y  *//p')
      printf -- '- %s and %s: %s\n' "$a" "$b" "$numbers"
    done
  done
  printf '\n## In real time: `parade`, preset `balanced`\n\n![parade](parade.apng)\n'
} > "$report.new"
mv "$report.new" "$report"

say "differences between the tracers"
grep -E '^(## |- )' "$report"
say "look at $out/*.png (the same values as floats are in $out/*.exr), side by side in $report"

say "ambient occlusion and the light of a white sky, which it stands in for"
"$skylit" compare --scene builtin:atrium --size "$size" --a "ao --spp $spp" --b "ao-sky --spp $((2 * spp))" --c balanced --html "$out/compare"
