#!/usr/bin/env bash
# Builds the Python package, checks its types, installs it into a fresh environment, and tests it, the contract and the scripts of its
# README against the built service.
#
#   tests/python/run.sh [BINARY]     default: the release build
#
# Packages go into the target directory; nothing is installed or generated outside it.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
scratch=$target/ci/python
package=$root/clients/python

binary=${1:-}
if [[ -z $binary ]]; then
    cargo build --release --bin feedwave --manifest-path "$root/Cargo.toml"
    binary=$target/release/feedwave
fi

mkdir -p "$scratch"
export PYTHONDONTWRITEBYTECODE=1 PIP_DISABLE_PIP_VERSION_CHECK=1
# The versions of the tests, in the fresh environment as well.
export PIP_CONSTRAINT=$here/requirements.txt
if ! cmp --silent "$here/requirements.txt" "$scratch/venv/requirements.txt"; then
    python3 -m venv --clear "$scratch/venv"
    "$scratch/venv/bin/pip" install --quiet -r "$here/requirements.txt"
    cp "$here/requirements.txt" "$scratch/venv/requirements.txt"
fi

# From the source distribution, so that it is known to have everything; it generates the modules of the contract.
rm -rf "$scratch/dist"
(cd "$package" && "$scratch/venv/bin/python" -m hatchling build -t sdist -d "$scratch/dist")
"$scratch/venv/bin/pip" wheel --quiet --no-deps --no-build-isolation -w "$scratch/dist" "$scratch"/dist/feedwave-*.tar.gz
pure=("$scratch"/dist/feedwave-*.whl)

# With the core as an extension, for programs without a service.
cargo fmt --check --manifest-path "$package/native/Cargo.toml"
CARGO_TARGET_DIR=$scratch/native "$scratch/venv/bin/maturin" build --quiet --release --locked --manifest-path "$package/native/Cargo.toml" \
    --interpreter "$scratch/venv/bin/python" --out "$scratch/dist/native"
native=("$scratch"/dist/native/*.whl)
(cd "$package" && FEEDWAVE_NATIVE_WHEEL=${native[0]} "$scratch/venv/bin/python" -m hatchling build -t wheel -d "$scratch/dist/with-native")
wheel=("$scratch"/dist/with-native/feedwave-*.whl)
"$scratch/venv/bin/pip" install --quiet --no-deps --force-reinstall "${wheel[0]}"

# The package as it is installed, and the scripts that a reader would write.
rm -rf "$scratch/scripts" "$scratch/mypy"
mkdir -p "$scratch/scripts"
(cd "$scratch/scripts" && "$scratch/venv/bin/python" "$here/scripts.py" "$package/README.md" .)
(cd "$scratch/scripts" && "$scratch/venv/bin/mypy" --config-file "$package/pyproject.toml" --cache-dir "$scratch/mypy" -p feedwave)
(cd "$scratch/scripts" && "$scratch/venv/bin/mypy" --config-file "$package/pyproject.toml" --cache-dir "$scratch/mypy" ./*.py)
# What is said of the extension is what it has.
(cd "$scratch/scripts" && "$scratch/venv/bin/python" -m mypy.stubtest --concise feedwave._native)

# Nothing but the package without the extension, and what it needs.
python3 -m venv --clear "$scratch/fresh"
"$scratch/fresh/bin/pip" install --quiet "${pure[0]}"
# The one with it, in an environment of its own.
python3 -m venv --clear "$scratch/fresh-native"
"$scratch/fresh-native/bin/pip" install --quiet "${wheel[0]}"

# A test that hangs ends the run, and says where it hung.
FEEDWAVE_BINARY=$(realpath "$binary") FEEDWAVE_FRESH_PYTHON=$scratch/fresh/bin/python \
    FEEDWAVE_FRESH_NATIVE_PYTHON=$scratch/fresh-native/bin/python MPLCONFIGDIR=$scratch/matplotlib \
    timeout --foreground 600 "$scratch/venv/bin/python" -m pytest -p no:cacheprovider -o faulthandler_timeout=300 -q "$here"
