#!/usr/bin/env bash
# Makes the compressed models of tests/loaders/compressed anew, by the encoders that people use: gltfpack, gltf-transform, draco3dgltf and
# Basis Universal, from npm. Tests read what it made, and never call it.
#
#   scripts/compressed/make.sh PROGRAM       PROGRAM: skylit, which exports the plain model
set -euo pipefail
program=$(realpath "$1")
cd "$(dirname "$0")/../.."
folder=$PWD/tests/loaders/compressed
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cp scripts/compressed/make.mjs "$work"
cd "$work"
npm install --silent --no-audit --no-fund gltfpack@1.3.0 @gltf-transform/core@4.5.1 @gltf-transform/extensions@4.5.1 @gltf-transform/functions@4.5.1 \
  draco3dgltf@1.5.7 meshoptimizer@1.3.0 ktx2-encoder@0.6.0 sharp@0.34

mkdir -p "$folder"
"$program" export builtin:leaf-cards "$folder/plain.glb" --quiet
node make.mjs "$folder/plain.glb" "$folder"
# what people call: quantized, filtered, with the newer extension
node node_modules/gltfpack/cli.js -cc -ce khr -i "$folder/plain.glb" -o "$folder/gltfpack.glb"
ls -l "$folder"
