#!/usr/bin/env bash
# Sets up what is needed, then checks the code and runs every test: once on the machine's driver, then the device tests again
# on the floor driver (Debian 12's own lavapipe: no ray tracing, compute tracer only).
#
#   ./scripts/test.sh [--full] [FILTER]      FILTER: only tests whose name contains it
#
# --full, before a release: every scene of the reference renderer (docs/mitsuba.md) on every tracer and driver and with the validation layer, every device test on
# the floor driver, every tracer for every test of paths, with the validation layer, and a million rays a scene in the parity gate.
# Without it the other tracers and the floor driver render the scenes in which they differ from the compute tracer, and a test of paths takes one tracer. Both do
# without the layer, which all other tests have, and one that compiles kernels of all features. The parity gate has a quarter of the rays. The floor driver leaves
# out tests of code that knows no driver: how paths are shaded (tests/path), what frames show (tests/realtime, but for those that compare tracers), and the
# program from outside (tests/cli, but for the program's own device tests).
#
# Tests run a process each, but for those of tracers, stills and paths: they run as threads of a process for each subject, so that they share a device and its
# pipelines. On a CPU driver compiling pipelines is most of what they cost.
#
# SKYLIT_EXPECT_TRACERS  tracers that must run; a missing one fails instead of being skipped. Set here for lavapipe; set it
#                        yourself for another device, or to nothing to skip what it lacks.
set -euo pipefail
cd "$(dirname "$0")/.."
full=
if [ "${1:-}" = --full ]; then full=1 && shift; fi
filter=${1:-}
# read by tests/mitsuba
if [ -n "$full" ]; then export SKYLIT_FULL=1; fi
# binaries whose tests share a device
shared=(tracer ao path mitsuba)

say() { printf 'test: %s\n' "$*"; }

log=$(mktemp)
summaries=$(mktemp)
# jobs in the background do not get Ctrl-C, and their tests are processes of their own
trap 'for job in $(jobs -p); do kill -- "-$job" 2>/dev/null || true; done; rm -f "$log"* "$summaries"' EXIT

# keep_summary LABEL: what the log says of a run, for the end
keep_summary() { grep -E '^ *Summary |^test result:' "$log" | sed "s/^ */test: $1: /" >> "$summaries" || true; }

# run_alone LABEL OPTION...: tests in processes of their own, those that nextest's options name
run_alone() {
  local label=$1 status=0
  shift
  cargo nextest run --locked --no-tests=pass --no-fail-fast "$@" 2>&1 | tee "$log" || status=$?
  keep_summary "$label"
  return "$status"
}

# run_shared LABEL BINARY... -- [NAME...]: tests of these binaries whose names contain one of the NAMEs; all without. The binaries run side by side: tests that
# share a device wait for each other's submissions. What they print appears when they have ended.
run_shared() {
  local label=$1 status=0 binaries=() binary
  shift
  while [ "$1" != -- ]; do binaries+=("$1") && shift; done
  cargo test --locked --no-run "${binaries[@]/#/--test=}"
  say "${binaries[*]}, side by side"
  # a process group for each, so that all of it can be ended
  set -m
  for binary in "${binaries[@]}"; do
    cargo test --locked --test="$binary" "$@" > "$log.$binary" 2>&1 && echo ok > "$log.$binary.ok" &
  done
  set +m
  wait
  for binary in "${binaries[@]}"; do
    cat "$log.$binary"
    if [ ! -f "$log.$binary.ok" ]; then status=1; fi
  done
  cat "${binaries[@]/#/$log.}" > "$log"
  rm -f "$log".*
  keep_summary "$label"
  return "$status"
}

# run_documentation: the examples in the library's documentation, which nextest knows nothing of
run_documentation() {
  local status=0
  cargo test --locked --doc 2>&1 | tee "$log" || status=$?
  keep_summary "documentation"
  return "$status"
}

./scripts/setup.sh

if cargo fmt --version >/dev/null 2>&1; then
  say "formatting"
  cargo fmt --check
fi
if cargo clippy --version >/dev/null 2>&1; then
  say "lints"
  # the program as it is released with its tests, which are the same for all; the library alone; and the program without benchmarks and viewer
  cargo clippy --locked --all-targets -- -D warnings
  cargo clippy --locked --no-default-features --lib -- -D warnings
  cargo clippy --locked --no-default-features --features cli --lib --bins -- -D warnings
fi

# rays of each set of the parity gate; a million otherwise
if [ -z "$full" ]; then export SKYLIT_PARITY_RAYS=${SKYLIT_PARITY_RAYS-250000}; fi

say "tests on the default driver"
export SKYLIT_EXPECT_TRACERS=${SKYLIT_EXPECT_TRACERS-pipeline,query,compute}
status=0
if cargo nextest --version >/dev/null 2>&1; then
  others=$(printf ' - binary(%s)' "${shared[@]}")
  run_alone "default driver" -E "all()$others" ${filter:+"$filter"} || status=1
  run_shared "default driver" "${shared[@]}" -- ${filter:+"$filter"} || status=1
  if [ -z "$filter" ]; then run_documentation || status=1; fi
else
  cargo test --locked --no-fail-fast -- ${filter:+"$filter"} 2>&1 | tee "$log" || status=1
  keep_summary "default driver"
fi

floor=${SKYLIT_DRIVERS_DIR:-$PWD/target/drivers}/mesa-22.3.6/lvp_icd.json
if [ -f "$floor" ]; then
  say "device tests on the floor driver, $floor"
  export VK_DRIVER_FILES=$floor VK_ICD_FILENAMES=$floor SKYLIT_EXPECT_TRACERS=compute SKYLIT_REQUIRE_DRIVER=22.3.6
  if [ -n "$filter" ]; then
    run_shared "floor driver" "${shared[@]}" realtime raster cli -- "$filter" || status=1
  elif [ -n "$full" ]; then
    run_shared "floor driver" "${shared[@]}" realtime raster cli renderer -- gpu_ || status=1
  else
    # rounding is the driver's, and fewer rays show what it does
    export SKYLIT_PARITY_RAYS=100000
    run_shared "floor driver" tracer ao mitsuba raster -- gpu_ || status=1
    run_shared "floor driver" realtime cli -- tracers:: program::gpu_ || status=1
  fi
else
  say "no floor driver here (setup.sh unpacks it on Debian 12): its tests are left out"
fi

cat "$summaries"
if [ "$status" != 0 ]; then say "FAILED"; exit 1; fi
say "all passed"
