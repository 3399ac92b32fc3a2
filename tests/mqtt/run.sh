#!/usr/bin/env bash
# Runs the tests that need an MQTT broker: each starts Debian's mosquitto on a port and in a folder of its own, and ends it.
#
#   tests/mqtt/run.sh [COMMAND]...
#
# The tests, or the command, which finds in FEEDWAVE_TEST_MOSQUITTO the folder of the programs. These are the ones that are installed, or
# else packages unpacked into the target directory, so that nothing is installed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
source .ci/debian

root=${CARGO_TARGET_DIR:-$PWD/target}/ci/mosquitto
readonly packages=(mosquitto mosquitto-clients libmosquitto1 libcjson1 libwrap0 libdlt2)
readonly programs=(mosquitto mosquitto_sub mosquitto_passwd)

missing() {
    echo "mosquitto cannot be had: $1" >&2
    exit 1
}

# The path of a program below a folder.
find_program() {
    local place
    for place in usr/sbin usr/bin; do
        [[ -x $1/$place/$2 ]] && echo "$1/$place/$2" && return
    done
    return 1
}

base=
for program in "${programs[@]}"; do
    find_program "" "$program" >/dev/null || base=$root
done
[[ -z $base ]] || unpack_debian "$root" "${packages[@]}" || missing "it is not installed"

# One folder for programs of two, with the libraries that come with them.
folder=$(mktemp -d "${TMPDIR:-/tmp}/feedwave-mqtt.XXXXXX")
# What tells a failure of the machine from one of the code: a full disk is not seen in a test.
report() {
    {
        echo "the last lines of each broker's log:"
        tail -n 20 "$folder"/*.log 2>/dev/null
        df -h "$folder"
    } >&2
}
begun=
finish() {
    local status=$?
    [[ $status -eq 0 || -z $begun ]] || report || true
    rm -rf "$folder"
}
trap finish EXIT
trap 'exit 1' INT TERM HUP
libraries=${base:+$(debian_libraries "$base")}
for program in "${programs[@]}"; do
    path=$(find_program "$base" "$program") || missing "there is no $program"
    printf '#!/bin/sh\nexec env %s%q "$@"\n' \
        "${libraries:+LD_LIBRARY_PATH=$(printf %q "$libraries") }" "$path" >"$folder/$program"
    chmod +x "$folder/$program"
done

export FEEDWAVE_TEST_MOSQUITTO=$folder
begun=yes
"$folder/mosquitto" -h | head -n 1 || true
if [[ $# -gt 0 ]]; then
    "$@"
else
    cargo test --workspace --test end_to_end -- mqtt:: --include-ignored
fi
