#!/usr/bin/env bash
# Sets up what is needed, then checks the code and runs every test: once on the machine's driver, then the device tests again
# on the floor driver (Debian 12's own lavapipe: no ray tracing, compute tracer only).
#
#   ./scripts/test.sh [--full] [FILTER]      FILTER: only tests whose name contains it
#
# --full, before a release: every scene of the reference renderer (docs/design/mitsuba.md) on every tracer and driver and with the validation layer, every device test on
# the floor driver, every tracer for every test of paths, with the validation layer, a million rays a scene in the parity gate, and reports in a browser (scripts/report.sh installs one), lints of the library alone and of the program without benchmarks and viewer.
# Without it the other tracers and the floor driver render the scenes in which they differ from the compute tracer, and a test of paths, of frames or of the renderer takes the tracer that its name picks, unless it compares them. Both do
# without the layer, which all other tests have, and one that compiles kernels of all features. The parity gate has a tenth of the rays (a hundredth on the floor driver, as other large sets of rays there a tenth), degenerate scenes a quarter and brute force a third of that, and frames at rest are followed in one of four scenes. The floor driver leaves
# out tests of code that knows no driver: scenes that change (tests/tracer), images that stop and go on (tests/ao), how paths are shaded (tests/path), what frames show (tests/realtime, but for those that compare tracers), and the
# program from outside (tests/cli, but for the program's own device tests). Reference frames (tests/frames, docs/guide/ci.md) are rendered on both drivers.
#
# Tests run a process each, but for those of tracers, stills and paths, and all on the floor driver: they run as threads of a process for each subject, so that they
# share a device and its pipelines. On a CPU driver compiling pipelines is most of what they cost. Those processes run side by side, one more than there are
# cores, the longest first: tests that share a device wait for each other.
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
# binaries whose tests share a device, longest first
shared=(path tracer mitsuba ao)

# what `time` prints: for a log that tells what takes long
TIMEFORMAT='test: took %0R s, %0U s of processor time'

# with the seconds since the start, for the same reason
say() { printf 'test: %4d s: %s\n' "$SECONDS" "$*"; }

log=$(mktemp)
summaries=$(mktemp)
# jobs in the background do not get Ctrl-C, and their tests are processes of their own
trap 'for job in $(jobs -p); do kill -- "-$job" 2>/dev/null || true; done; rm -f "$log"* "$summaries"' EXIT

# keep_summary LABEL: what the log says of a run, for the end
keep_summary() { grep -E '^ *Summary |^test result:|^[0-9]+ renders?:' "$log" | sed "s/^ */test: $1: /" >> "$summaries" || true; }

# run_alone LABEL OPTION...: tests in processes of their own, those that nextest's options name
run_alone() {
  local label=$1 status=0
  shift
  # one more than cores: some wait, for a window or a signal
  time cargo nextest run --locked --lib --bins --tests --no-tests=pass --no-fail-fast --test-threads $(($(nproc) + 1)) "$@" 2>&1 | tee "$log" || status=$?
  keep_summary "$label"
  return "$status"
}

# The processes that run_queue runs: the driver and the binary of each, and the names of its tests, separated by spaces (none: all tests).
queue=()
# enqueue DRIVER BINARY [NAME...]: DRIVER is default or floor; BINARY frames are the project's own reference frames
enqueue() { queue+=("$*"); }

# run_entry DRIVER BINARY [NAME...]: one process, whose tests have one of the NAMEs in theirs; `--skip NAME`: not those
run_entry() {
  local driver=$1 binary=$2
  shift 2
  if [ "$driver" = floor ]; then
    export VK_DRIVER_FILES=$floor VK_ICD_FILENAMES=$floor SKYLIT_EXPECT_TRACERS=compute SKYLIT_REQUIRE_DRIVER=22.3.6
    # rounding is the driver's, and fewer rays show what it does
    if [ -z "$full" ]; then export SKYLIT_PARITY_RAYS=10000; fi
  fi
  if [ "$binary" = frames ]; then
    time "${CARGO_TARGET_DIR:-target}/debug/skylit" verify tests/frames
  else
    time cargo test --locked --test="$binary" -- "$@"
  fi
}

# run_queue: what was enqueued. What a process prints appears when all have ended.
run_queue() {
  local entry driver binary names status=0 k=0 binaries=()
  for entry in "${queue[@]}"; do
    read -r driver binary names <<< "$entry"
    if [ "$binary" = frames ]; then cargo build --locked --features probes; else binaries+=("--test=$binary"); fi
  done
  cargo test --locked --no-run "${binaries[@]}"
  for entry in "${queue[@]}"; do
    # processes end in any order
    while [ "$(jobs -pr | wc -l)" -gt "$(nproc)" ]; do wait -n || true; done
    read -r driver binary names <<< "$entry"
    say "$binary, $driver driver"
    # a process group for each, so that all of it can be ended
    set -m
    # the names are words
    # shellcheck disable=SC2086
    { run_entry "$driver" "$binary" $names > "$log.$k" 2>&1 && echo ok > "$log.$k.ok"; } &
    set +m
    k=$((k + 1))
  done
  wait
  k=0
  for entry in "${queue[@]}"; do
    read -r driver binary names <<< "$entry"
    cat "$log.$k"
    if [ ! -f "$log.$k.ok" ]; then status=1; fi
    cp "$log.$k" "$log"
    keep_summary "$driver driver, $binary"
    k=$((k + 1))
  done
  rm -f "$log".*
  return "$status"
}

# run_documentation: the examples in the library's documentation, which nextest knows nothing of
run_documentation() {
  local status=0
  time cargo test --locked --doc 2>&1 | tee "$log" || status=$?
  keep_summary "documentation"
  return "$status"
}

./scripts/setup.sh

if cargo fmt --version >/dev/null 2>&1; then
  say "formatting"
  cargo fmt --check
  # modules that macros declare: cargo fmt does not visit them
  rustfmt --edition 2024 --check src/scene/lights/*.rs src/realtime/passes/*.rs
fi
say "documents"
python3 scripts/check_docs.py
. scripts/linting-compiler.sh
say "lints of benchmarks and examples"
cargo build --locked --benches --examples
if [ -n "$full" ] && cargo clippy --version >/dev/null 2>&1; then
  # the library alone, and the program without benchmarks and viewer
  cargo clippy --locked --no-default-features --lib -- -D warnings
  cargo clippy --locked --no-default-features --features cli --lib --bins -- -D warnings
fi

# rays of each set of the parity gate; a million otherwise
if [ -z "$full" ]; then export SKYLIT_PARITY_RAYS=${SKYLIT_PARITY_RAYS-100000}; fi

floor=${SKYLIT_DRIVERS_DIR:-$PWD/target/drivers}/mesa-22.3.6/lvp_icd.json
if [ ! -f "$floor" ]; then
  say "no floor driver here (setup.sh unpacks it on Debian 12): its tests are left out"
  floor=
fi

export SKYLIT_EXPECT_TRACERS=${SKYLIT_EXPECT_TRACERS-pipeline,query,compute}
status=0
if cargo nextest --version >/dev/null 2>&1; then
  say "tests that run alone"
  others=$(printf ' - binary(%s)' "${shared[@]}")
  run_alone "default driver" -E "all()$others" ${filter:+"$filter"} || status=1
  # their floor driver's part is as long as that of the default driver: enqueued next to each other
  for binary in "${shared[@]}"; do
    if [ "$binary$filter" = path ]; then
      # three processes of about the same time by subjects, since tests of one wait for each other
      first="cli:: film:: frames:: lag::"
      second="light_groups:: lit:: materials:: transport:: validation::"
      # shellcheck disable=SC2086
      enqueue default path $first
      # shellcheck disable=SC2086
      enqueue default path $second
      # shellcheck disable=SC2046
      enqueue default path $(printf -- '--skip %s ' $first $second)
    else
      # shellcheck disable=SC2086
      enqueue default "$binary" $filter
    fi
    [ -n "$floor" ] || continue
    case $full$filter,$binary in
      ,path) ;;
      # its kernels take ten times as long as the newer driver's: what they compute, and not how scenes change
      ,tracer) enqueue floor tracer degenerate:: kernel:: parity:: sampler:: ;;
      # what they compute, and not how images stop and go on
      ,ao) enqueue floor ao aov:: closed_forms:: images:: rays:: ;;
      *) enqueue floor "$binary" "${filter:-gpu_}" ;;
    esac
  done
else
  say "tests on the default driver"
  cargo test --locked --no-fail-fast -- ${filter:+"$filter"} 2>&1 | tee "$log" || status=1
  keep_summary "default driver"
  for binary in "${shared[@]}"; do if [ -n "$floor" ]; then enqueue floor "$binary" "${filter:-gpu_}"; fi; done
fi
if [ -n "$floor" ]; then
  enqueue floor raster "${filter:-gpu_}"
  if [ -n "$filter$full" ]; then
    for binary in realtime cli renderer; do enqueue floor "$binary" "${filter:-gpu_}"; done
  else
    enqueue floor realtime tracers:: program::gpu_
    enqueue floor cli tracers:: program::gpu_
  fi
fi
if [ -z "$filter" ]; then
  enqueue default frames
  if [ -n "$floor" ]; then enqueue floor frames; fi
fi
say "tests that share a device"
if [ "${#queue[@]}" -gt 0 ]; then run_queue || status=1; fi
if [ -z "$filter" ]; then run_documentation || status=1; fi

if [ -n "$full" ] && [ -z "$filter" ]; then
  say "reports in a browser"
  cargo build --locked
  ./scripts/report.sh "${CARGO_TARGET_DIR:-target}/debug/skylit" || status=1
fi

cat "$summaries"
if [ "$status" != 0 ]; then say "FAILED"; exit 1; fi
say "all passed"
