#!/usr/bin/env bash
# Fuzzes targets one after another and names those that found something.
#
#   fuzz/run.sh [SECONDS [TARGET...]]     seconds of each target, by default 720: an hour for all five
#
# Needs the nightly compiler and cargo-fuzz (`cargo install cargo-fuzz`). The programs of the tests are where `parser` and `lexer`
# begin; what is found interesting is kept in the target directory for the next time.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
seconds=${1:-720}
targets=("${@:2}")
[[ ${#targets[@]} -gt 0 ]] || targets=(parser flow lexer telemetry upload)
work=${CARGO_TARGET_DIR:-$PWD/target}/fuzz
export CARGO_TARGET_DIR=$work

# The bytes before a program, as `parser` takes them: settings, and the length of pieces.
settings=('\x00\x10' '\x01\x07' '\x80\x40' '\x11\x20')
mkdir -p "$work"/corpus/{parser,flow,lexer,telemetry,upload}
mapfile -t programs < <(find tests/fixtures tests/reference/programs -name '*.nc' -o -name '*.ngc')
for program in "${programs[@]}"; do
    name=$(tr / - <<<"$program")
    # A program of a megabyte is one case a second.
    [[ $(stat -c %s "$program") -le 4096 ]] || continue
    for at in "${!settings[@]}"; do
        { printf '%b' "${settings[$at]}" && cat "$program"; } >"$work/corpus/parser/$at-$name"
    done
done
cat "${programs[@]}" | grep -a . | sort -u | awk 'NR <= 2000' | split -l 1 -a 4 - "$work/corpus/lexer/line-"

failed=()
for target in "${targets[@]}"; do
    log=$work/$target.log
    # The sources forbid `unsafe`: what a sanitizer would watch is SQLite, which is fuzzed elsewhere.
    if cargo +nightly fuzz run --sanitizer none "$target" "$work/corpus/$target" -- -max_total_time="$seconds" \
        -max_len=4096 -timeout=10 -rss_limit_mb=2048 -artifact_prefix="$work/$target-" >"$log" 2>&1; then
        printf '%s: %s\n' "$target" "$(grep '^Done' "$log")"
    else
        failed+=("$target")
        printf '%s: see %s\n' "$target" "$log"
        grep -A3 -E 'panicked|^error|ALARM|ERROR' "$log" | head -n 20 || true
    fi
done
[[ ${#failed[@]} -eq 0 ]]
