#!/usr/bin/env bash
# Renders and describes every glTF and OBJ file of a folder, each in a process of its own with limits of time and memory, and sums up: how many are ok, refused and why,
# crashed, slow, all but black or white. For files that others made: docs/reference/formats.md has a table.
#
#   ./scripts/corpus.sh PROGRAM FOLDER [--output OUT] [--jobs N] [--stress]     PROGRAM: target/release/skylit; OUT: where table and results go [default: corpus];
#                                                                              --stress: also `PROGRAM stress FILE --quick`, where the program has the command
#
# It fails (exit code 1) if a file crashes the program.
set -euo pipefail
exec python3 "$(dirname "$0")/corpus/corpus.py" "$@"
