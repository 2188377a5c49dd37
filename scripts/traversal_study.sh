#!/usr/bin/env bash
# Prints the tables of docs/notebook/2026-11-22-which-child-first.md: orders of traversal, triangle tests, leaks. About five minutes on two cores.
#
#   ./scripts/traversal_study.sh [-o orders|tests|leaks] [-- WRAPPER...]
#
# WRAPPER  a command that every measurement is run under, such as `taskset -c 0,1` or one that keeps other jobs away
set -euo pipefail
cd "$(dirname "$0")/.."

only=
if [ "${1:-}" = -o ]; then only=${2:?orders, tests or leaks}; shift 2; fi
if [ "${1:-}" = -- ]; then shift; fi

shared=${SKYLIT_SHARED_SCENES:-../shared/scenes}
cargo build --release --locked --example traversal_study >&2
study=${CARGO_TARGET_DIR:-target}/release/examples/traversal_study

wanted() { [ -z "$only" ] || [ "$only" = "$1" ]; }

# row STUDY SCENE [OPTION...]: scenes that are not there are left out, and said to be
row() {
  local what=$1 scene=$2
  shift 2
  case $scene in
    builtin:*) ;;
    *)
      scene=$shared/$scene
      if [ ! -f "$scene" ]; then echo "traversal_study: no $scene: left out" >&2; return; fi
      ;;
  esac
  "${wrapper[@]}" "$study" "$what" "$scene" "$@"
}
wrapper=("$@")
dragon=(dragon/dragon.glb --eye=0.065,0.1857,0.198 --target=-0.0059,0.125,-0.0046)
sponza=(sponza/sponza.glb --eye=-120,20,-5 --target=50,35,0 --fov-y 70)

if wanted orders; then
  "$study" orders --header
  for n in 100 200 500 1000 2000 5000 8000 10000; do row orders "builtin:spheres:$n"; done
  for name in MonkeyModel Cottage CottageWalls WoodScene; do row orders "falcone/$name.obj"; done
  row orders bunny/bunny.glb
  row orders "${sponza[@]}"
  row orders "${dragon[@]}"
  echo
fi
if wanted tests; then
  "$study" tests --header
  row tests bunny/bunny.glb
  row tests "${sponza[@]}"
  row tests "${dragon[@]}"
  echo
fi
if wanted leaks; then
  "$study" leaks --header
  "${wrapper[@]}" "$study" leaks
fi
