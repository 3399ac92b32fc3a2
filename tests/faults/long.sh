#!/bin/sh
# The long form of the fault bench: every test again and again with other moments, everything at once under kill -9, random
# messages to every method, time and memory against size, and a full disk that is a real one.
# Usage: tests/faults/long.sh [ROUNDS]; needs root for the small file system. Its figures go to docs/reliability.md.
set -eu
cd "$(dirname "$0")/../.."
rounds=${1:-20}
faults() { cargo test --quiet --workspace --test faults -- "$@"; }
for round in $(seq "$rounds"); do
    echo "round $round of $rounds"
    PROPTEST_RNG_SEED=$round faults
    PROPTEST_RNG_SEED=$round cargo test --quiet --workspace --test end_to_end -- audit durability uploads validation_queue
done
echo "$rounds rounds passed"
FEEDWAVE_MIXED_KILLS=60 faults mixed --nocapture
FEEDWAVE_FUZZ_REQUESTS=50000 faults methods --nocapture
FEEDWAVE_REPLICA_FAULTS=100 tests/postgres/run.sh cargo test --quiet --workspace --test faults -- replicas:: --ignored --nocapture --test-threads 1
faults scaling --ignored --nocapture
if [ "$(id -u)" = 0 ]; then
    # Temporary files of the tests on 48 MiB: the disk is full for real.
    small=$(mktemp -d)
    mount -t tmpfs -o size=48m tmpfs "$small"
    trap 'umount "$small"; rmdir "$small"' EXIT
    TMPDIR=$small faults small_disk --ignored
    echo "small disk passed"
fi
