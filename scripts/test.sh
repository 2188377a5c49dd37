#!/usr/bin/env bash
# Sets up what is needed, then checks the code and runs every test: once on the machine's driver, then the device tests again
# on the floor driver (Debian 12's own lavapipe: no ray tracing, compute tracer only).
#
#   ./scripts/test.sh [--full] [FILTER]      FILTER: only tests whose name contains it
#
# --full, before a release: every scene of the reference renderer (docs/mitsuba.md) on every tracer and driver, and every device test on the floor driver.
# Without it the other tracers and the floor driver render the scenes in which they differ from the compute tracer, and the floor driver leaves out tests of
# code that knows no driver: how paths are shaded (tests/path), and what frames show (tests/realtime, but for those that compare tracers).
#
# SKYLIT_EXPECT_TRACERS  tracers that must run; a missing one fails instead of being skipped. Set here for lavapipe; set it
#                        yourself for another device, or to nothing to skip what it lacks.
set -euo pipefail
cd "$(dirname "$0")/.."
full=
if [ "${1:-}" = --full ]; then full=1 && shift; fi
filter=${1:-}
# read by tests/judge.rs
if [ -n "$full" ]; then export SKYLIT_FULL=1; fi

say() { printf 'test: %s\n' "$*"; }

log=$(mktemp)
summaries=$(mktemp)
trap 'rm -f "$log" "$summaries"' EXIT

# run_tests LABEL [NAME...]: runs the tests whose names contain one of the NAMEs; all without. Keeps the summary for the end.
run_tests() {
  local label=$1 status=0
  shift
  if cargo nextest --version >/dev/null 2>&1; then
    cargo nextest run --locked --no-tests=pass --no-fail-fast "$@" 2>&1 | tee "$log" || status=$?
  else
    cargo test --locked --no-fail-fast -- "$@" 2>&1 | tee "$log" || status=$?
  fi
  grep -E '^ *Summary |^test result:' "$log" | sed "s/^ */test: $label: /" >> "$summaries" || true
  return "$status"
}

./scripts/setup.sh

if cargo fmt --version >/dev/null 2>&1; then
  say "formatting"
  cargo fmt --check
fi
if cargo clippy --version >/dev/null 2>&1; then
  say "lints"
  # the program as it is released, the library alone, and the program without benchmarks
  for features in "" "--no-default-features" "--no-default-features --features cli"; do
    # shellcheck disable=SC2086 # words, or none
    cargo clippy --locked $features --all-targets -- -D warnings
  done
fi

say "tests on the default driver"
export SKYLIT_EXPECT_TRACERS=${SKYLIT_EXPECT_TRACERS-pipeline,query,compute}
status=0
run_tests "default driver" ${filter:+"$filter"} || status=1

floor=${SKYLIT_DRIVERS_DIR:-$PWD/target/drivers}/mesa-22.3.6/lvp_icd.json
if [ -f "$floor" ]; then
  say "device tests on the floor driver, $floor"
  export VK_DRIVER_FILES=$floor VK_ICD_FILENAMES=$floor SKYLIT_EXPECT_TRACERS=compute SKYLIT_REQUIRE_DRIVER=22.3.6
  if [ -n "$filter" ]; then
    names=("$filter")
  elif [ -n "$full" ] || ! cargo nextest --version >/dev/null 2>&1; then
    names=(gpu_ floor_)
  else
    names=(-E '(test(gpu_) - binary(path) - (binary(realtime) - test(/^tracers::/))) + test(floor_)')
  fi
  run_tests "floor driver" "${names[@]}" || status=1
else
  say "no floor driver here (setup.sh unpacks it on Debian 12): its tests are left out"
fi

cat "$summaries"
if [ "$status" != 0 ]; then say "FAILED"; exit 1; fi
say "all passed"
