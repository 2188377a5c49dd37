# Sourced by test.sh and .ci/run: cargo compiles the project with the compiler of clippy, which lints what it compiles, and any lint is an error.
# One compilation serves lints and tests. `cargo clippy` would check every dependency besides, four minutes on two cores.
#
# Without clippy the plain compiler is used, and nothing is linted.
if command -v clippy-driver >/dev/null; then
  export RUSTC_WORKSPACE_WRAPPER=clippy-driver CLIPPY_ARGS=-Dwarnings
fi
