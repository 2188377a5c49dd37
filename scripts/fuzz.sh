#!/usr/bin/env bash
# Fuzzes what reads files: each target of fuzz/src/targets.rs for some time, one after the other, with libFuzzer and the stable compiler.
#
#   ./scripts/fuzz.sh [--seconds N] [--rounds N] [TARGET...]     N seconds each [default: 60], so many times [default: 1; 0: until it is ended]; all targets unless some are named
#
# What is interesting is kept in fuzz/corpus/TARGET and taken up by the next run; fuzz/seeds/TARGET begins it. What ends a target, takes more than 20 s or 2 GiB is a finding: its bytes are
# left in fuzz/artifacts/TARGET, the others go on, and the exit code is 1. To see a finding again: `target/fuzz/x86_64-unknown-linux-gnu/release/TARGET fuzz/artifacts/TARGET/FILE`.
# fuzz/artifacts/seconds.txt has a line for each: target, seconds of processor time, runs.
#
# Needs g++ for libFuzzer, which comes with the package libfuzzer-sys. The first run compiles the project with instrumentation: some ten minutes on two cores. `cargo fuzz run --sanitizer none
# TARGET` does the same, where it is installed.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=60
rounds=1
while [ $# -gt 0 ]; do
  case $1 in
    --seconds) seconds=$2 && shift 2 ;;
    --rounds) rounds=$2 && shift 2 ;;
    --help | -h) sed -n '2,/^set/p' "$0" | sed '$d; s/^# \{0,1\}//' && exit ;;
    *) break ;;
  esac
done
all=(gltf glb draco meshopt ktx2 dds obj mtl brhan hdr exr png camera_path manifest film hierarchy mesh_bin settings)
targets=("${@:-${all[@]}}")

host=$(rustc -vV | sed -n 's/^host: //p')
folder=${SKYLIT_FUZZ_TARGET_DIR:-${CARGO_TARGET_DIR:-target}/fuzz}
# what libFuzzer steers by: counters of edges, and the operands of comparisons
coverage=(-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 -Cllvm-args=-sanitizer-coverage-inline-8bit-counters
  -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares -Cllvm-args=-simplifycfg-branch-fold-threshold=0 -Ccodegen-units=1)
# `--target`: else build scripts would be instrumented, and not find libFuzzer
RUSTFLAGS="--cfg fuzzing ${coverage[*]}" cargo build --release --locked --manifest-path fuzz/Cargo.toml --target "$host" --target-dir "$folder"

# files that targets read are written very often: to memory, where there is such a folder
temporary=$(mktemp -d -p "$([ -d /dev/shm ] && echo /dev/shm || echo "${TMPDIR:-/tmp}")")
trap 'rm -rf "$temporary"' EXIT
trap 'exit 130' INT TERM
export TMPDIR=$temporary
TIMEFORMAT='%U %S'

found=0
for ((round = 0; rounds == 0 || round < rounds; round++)); do
  for target in "${targets[@]}"; do
    mkdir -p "fuzz/corpus/$target" "fuzz/artifacts/$target"
    status=0
    { time "$folder/$host/release/$target" "fuzz/corpus/$target" "fuzz/seeds/$target" -artifact_prefix="fuzz/artifacts/$target/" \
      -max_total_time="$seconds" -timeout=20 -rss_limit_mb=2048 -max_len=65536 -print_final_stats=1 > "$temporary/log" 2>&1; } 2> "$temporary/time" || status=$?
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$temporary/log")
    awk -v target="$target" -v runs="${runs:-0}" '{ print target, $1 + $2, runs }' "$temporary/time" >> fuzz/artifacts/seconds.txt
    echo "fuzz: $target: ${runs:-0} runs, $(ls "fuzz/corpus/$target" | wc -l) files in its corpus$([ $status = 0 ] || echo ", a FINDING in fuzz/artifacts/$target")"
    if [ $status != 0 ]; then
      found=1
      tail -30 "$temporary/log" | sed 's/^/  /'
    fi
    rm -rf "$temporary"/.tmp*
  done
done
exit $found
