#!/usr/bin/env bash
# Holds the actions of `feedwave interpret` against those of LinuxCNC's interpreter: motion, feeds, dwells, refusals.
#
#   tests/reference/run.sh [OPTION OF compare.py]...
#
# Takes the interpreter from Debian's packages (bookworm), unpacked into the target directory, so that nothing is installed; it
# runs with the Python of the same Debian. FEEDWAVE names a built binary; without it one is built.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
source .ci/debian

scratch=${CARGO_TARGET_DIR:-$PWD/target}/ci
root=$scratch/linuxcnc
readonly packages=(linuxcnc-uspace libboost-python1.74.0)

missing() {
    echo "the reference interpreter cannot be had: $1" >&2
    exit 1
}

unpack_debian "$root" "${packages[@]}" || missing "it cannot be unpacked"

libraries=$root/usr/lib:$(debian_libraries "$root")
modules=$root/usr/lib/python3/dist-packages
# The module is built for one version of Python.
version=$(basename "$modules"/gcode.cpython-*.so | sed -E 's/gcode\.cpython-3([0-9]+)-.*/3.\1/')
python=/usr/bin/python$version
[[ -x $python ]] || missing "it needs $python, Debian's own"
export LD_LIBRARY_PATH=$libraries PYTHONPATH=$modules PYTHONDONTWRITEBYTECODE=1
"$python" -c 'import gcode' 2>"$root/import.log" || missing "its module does not load: $(tail -n 1 "$root/import.log")"

if [[ -z ${FEEDWAVE:-} ]]; then
    LD_LIBRARY_PATH='' cargo build --release --quiet -p feedwave
    FEEDWAVE=${CARGO_TARGET_DIR:-$PWD/target}/release/feedwave
fi
exec "$python" tests/reference/compare.py --feedwave "$FEEDWAVE" --python "$python" "$@"
