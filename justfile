# What contributors run; CONTRIBUTING.md explains each. `just` alone lists them.

_list:
    @just --list --unsorted

# sets up, builds, renders and compares
demo:
    ./scripts/demo.sh

# all tests, or those whose name contains NAME
test NAME="":
    ./scripts/test.sh {{ NAME }}

# what takes hours, before a release
full:
    ./scripts/test.sh --full

# what continuous integration runs
ci:
    ./.ci/run

# formatting and lints
lint:
    cargo fmt --check
    cargo clippy --locked --all-targets -- -D warnings

# documentation of the library
docs:
    cargo doc --locked --no-deps --document-private-items

# documentation as a book, in target/book
book:
    mdbook build

# pages of all commands and options, from the program's own definitions
reference:
    cargo run --locked -- man docs/reference/commands --format markdown

# the program for Windows, tried under Wine
windows:
    ./scripts/windows.sh check

# what is compiled for Windows and macOS alone, by the compiler's check
systems:
    ./scripts/other_systems.sh

# a kit for a machine with a GPU
gpu:
    ./scripts/gpu.sh

# pages of docs/results from their records; `just results measure --quick` measures
results *ARGS:
    python3 scripts/results.py {{ ARGS }}
