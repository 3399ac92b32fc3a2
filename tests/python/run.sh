#!/usr/bin/env bash
# Tests the service with a Python client whose stubs are generated from the contract here and now.
#
#   tests/python/run.sh [BINARY]     default: the release build
#
# Packages and stubs go into the target directory; nothing is installed outside it.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$here/../..
target=${CARGO_TARGET_DIR:-$root/target}
scratch=$target/ci/python

binary=${1:-}
if [[ -z $binary ]]; then
    cargo build --release --bin feedwave --manifest-path "$root/Cargo.toml"
    binary=$target/release/feedwave
fi

if ! cmp --silent "$here/requirements.txt" "$scratch/venv/requirements.txt"; then
    python3 -m venv --clear "$scratch/venv"
    "$scratch/venv/bin/pip" install --quiet --disable-pip-version-check -r "$here/requirements.txt"
    cp "$here/requirements.txt" "$scratch/venv/requirements.txt"
fi

rm -rf "$scratch/stubs"
mkdir -p "$scratch/stubs"
(cd "$root/proto" && "$scratch/venv/bin/python" -m grpc_tools.protoc -I . \
    --python_out="$scratch/stubs" --grpc_python_out="$scratch/stubs" feedwave/v1/*.proto)

FEEDWAVE_BINARY=$(realpath "$binary") PYTHONPATH=$scratch/stubs PYTHONDONTWRITEBYTECODE=1 \
    "$scratch/venv/bin/python" -m pytest -p no:cacheprovider -q "$here"
