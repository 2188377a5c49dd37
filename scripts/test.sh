#!/usr/bin/env bash
# Sets up what is needed, then checks the code and runs every test: once on the machine's driver, then the device tests again
# on the floor driver (Debian 12's own lavapipe: no ray tracing, compute tracer only).
#
#   ./scripts/test.sh [FILTER]      FILTER: only tests whose name contains it
#
# SKYLIT_EXPECT_TRACERS  tracers that must run; a missing one fails instead of being skipped. Set here for lavapipe; set it
#                        yourself for another device, or to nothing to skip what it lacks.
set -euo pipefail
cd "$(dirname "$0")/.."
filter=${1:-}

say() { printf 'test: %s\n' "$*"; }

# Runs the tests whose names contain one of the arguments; all without arguments.
run_tests() {
  if cargo nextest --version >/dev/null 2>&1; then
    cargo nextest run --locked --no-tests=pass --no-fail-fast "$@"
  else
    cargo test --locked --no-fail-fast -- "$@"
  fi
}

./scripts/setup.sh

if cargo fmt --version >/dev/null 2>&1; then
  say "formatting"
  cargo fmt --check
fi
if cargo clippy --version >/dev/null 2>&1; then
  say "lints"
  cargo clippy --locked --all-targets -- -D warnings
fi

say "tests on the default driver"
export SKYLIT_EXPECT_TRACERS=${SKYLIT_EXPECT_TRACERS-pipeline,query,compute}
run_tests ${filter:+"$filter"}

floor=${SKYLIT_DRIVERS_DIR:-$PWD/target/drivers}/mesa-22.3.6/lvp_icd.json
if [ -f "$floor" ]; then
  say "device tests on the floor driver, $floor"
  export VK_DRIVER_FILES=$floor VK_ICD_FILENAMES=$floor SKYLIT_EXPECT_TRACERS=compute SKYLIT_REQUIRE_DRIVER=22.3.6
  if [ -n "$filter" ]; then run_tests "$filter"; else run_tests gpu_ floor_; fi
else
  say "no floor driver here (setup.sh unpacks it on Debian 12): its tests are left out"
fi
say "all passed"
