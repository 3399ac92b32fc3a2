#!/usr/bin/env bash
# Runs the random tests of the pure crates with other seeds than that of the project, and names those that fail.
#
#   tests/seeds.sh [FIRST [LAST]]     seeds, by default 1 to 200; takes hours
#
# The tests are built once. What a seed finds is mended or explained, and becomes a test of its own with its numbers.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
first=${1:-1}
last=${2:-200}
crates=(feedwave-program feedwave-motion feedwave-cutting feedwave-monitoring feedwave-simulator)

# The functions of all `proptest!` blocks: up to the brace that stands below the block's beginning.
names=$(awk '/^ *proptest! \{/ { inside = 1; match($0, /^ */); indent = RLENGTH; next }
    inside && match($0, /^ *\}/) && RLENGTH == indent + 1 { inside = 0 }
    inside && match($0, /^ *fn [a-z0-9_]+\(/) { sub(/^ *fn /, ""); sub(/\(.*/, ""); print }' \
    $(grep -rl --include='*.rs' 'proptest! {' "${crates[@]/#feedwave-/service/}") | sort -u)
executables=$(cargo test "${crates[@]/#/--package=}" --lib --tests --no-run 2>&1 |
    sed -n 's/^ *Executable .*(\(.*\))$/\1/p')
[[ -n $names && -n $executables ]]

# The random tests of each executable.
declare -A random
count=0
for executable in $executables; do
    listed=$("$executable" --list)
    tests=$(sed -n 's/: test$//p' <<<"$listed" | grep -E "(^|::)($(paste -sd'|' <<<"$names"))\$" || true)
    [[ -n $tests ]] || continue
    random[$executable]=$tests
    count=$((count + $(wc -l <<<"$tests")))
done
printf '%d random tests in %d executables\n' "$count" "${#random[@]}"

failed=0
for seed in $(seq "$first" "$last"); do
    for executable in "${!random[@]}"; do
        # shellcheck disable=SC2086
        if ! output=$(PROPTEST_RNG_SEED=$seed "$executable" --exact ${random[$executable]} 2>&1); then
            failed=$((failed + 1))
            printf 'seed %d: %s\n' "$seed" "$(basename "$executable")"
            grep -A3 -E "panicked|minimal failing input" <<<"$output" | head -c 4000 || true
        fi
    done
    printf 'seed %d done, %d failures so far\n' "$seed" "$failed"
done
[[ $failed -eq 0 ]]
