#!/usr/bin/env bash
# Runs the tests that need a PostgreSQL server, on one of their own: its own folder, a free port of this machine, and gone
# with this script.
#
#   tests/postgres/run.sh [COMMAND]...
#
# The store's suite, the end-to-end tests and replicas under faults, or the command, which finds in FEEDWAVE_TEST_STORE the
# URI of a store with {} where the name of an empty database goes. The server is Debian's: the one that is installed, or else packages unpacked into the target
# directory, so that nothing is installed.
#
# FEEDWAVE_TEST_FSYNC=on has it force out what it commits, for figures of what is durable.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
source .ci/debian

scratch=${CARGO_TARGET_DIR:-$PWD/target}/ci
root=$scratch/postgresql
readonly packages=(postgresql-15 postgresql-client-15 libpq5 libicu72 libldap-2.5-0 libsasl2-2 libxml2 libgssapi-krb5-2)

missing() {
    echo "the PostgreSQL server cannot be had: $1" >&2
    exit 1
}

# The folder of the programs of the newest server.
programs() {
    find "$1/usr/lib/postgresql" -path '*/bin/initdb' -printf '%h\n' 2>/dev/null | sort -V | tail -n 1
}

libraries=
bin=$(programs '')
if [[ -z $bin ]]; then
    unpack_debian "$root" "${packages[@]}" || missing "it is not installed"
    bin=$(programs "$root")
    libraries=$(debian_libraries "$root")
fi
[[ -x $bin/postgres ]] || missing "no server in ${bin:-/usr/lib/postgresql}"

folder=$(mktemp -d "${TMPDIR:-/tmp}/feedwave-postgres.XXXXXX")
# The server refuses to run as root.
as=()
if [[ $(id -u) -eq 0 ]]; then
    user=nobody
    as=(setpriv --reuid "$user" --regid "$(id -g "$user")" --clear-groups)
    chown "$user" "$folder"
fi
# Whether the server runs: one that has ended may still wait to be buried.
runs() {
    local state
    state=$(awk '{ print $3 }' "/proc/$(cat "$folder/pid" 2>/dev/null || echo none)/stat" 2>/dev/null) && [[ $state != Z ]]
}

# Starts it on a port; whether it takes connections. It is the process that crashes here, never the machine: what was written is there
# without being forced out, and a start after a crash does not go through the files of all databases of the tests.
start() {
    : >"$folder/server.log"
    # Of a group of its own, and through no shell that waits: the process that is ended is the server's.
    setsid "${as[@]}" env LD_LIBRARY_PATH="$libraries" LC_ALL=C "$bin/postgres" -D "$folder/data" -p "$1" -k "$folder" \
        -c listen_addresses=127.0.0.1 -c max_connections=400 -c jit=off -c log_min_messages=warning -c "fsync=${FEEDWAVE_TEST_FSYNC:-off}" \
        -c ssl=on -c ssl_cert_file=database.pem -c ssl_key_file=database-key.pem -c ssl_ca_file=ca.pem \
        >>"$folder/server.log" 2>&1 </dev/null &
    echo "$!" >"$folder/pid"
    local _
    for _ in $(seq 3000); do
        runs || return 1
        grep -q 'database system is ready to accept connections' "$folder/server.log" && return 0
        sleep 0.1
    done
    return 1
}

# Ends it by a signal, and waits until it has ended.
end() {
    runs || return 0
    kill "-$1" "$(cat "$folder/pid")"
    while runs; do sleep 0.05; done
}

# What tells a failure of the machine from one of the code: a full disk is not seen in a test.
report() {
    {
        echo "the last lines of the server's log:"
        tail -n 20 "$folder/server.log"
        df -h "$folder"
    } >&2
}
begun=
finish() {
    local status=$?
    [[ $status -eq 0 || -z $begun ]] || report || true
    end INT || true
    rm -rf "$folder"
}
trap finish EXIT
trap 'exit 1' INT TERM HUP

run() {
    (cd "$folder" && exec "${as[@]}" env LD_LIBRARY_PATH="$libraries" LC_ALL=C "$@")
}

run "$bin/initdb" --pgdata "$folder/data" --username feedwave --auth trust --encoding UTF8 --locale C \
    >"$folder/initdb.log" 2>&1 || missing "initdb failed: $(tail -n 1 "$folder/initdb.log")"

# With certificates, for those who ask to be sure of it and of what is between; of this user it asks for one itself.
readonly certificates=tests/fixtures/tls sworn=sworn
# The server may not be able to read this folder, and wants the key to be its own.
for file in database.pem database-key.pem ca.pem; do
    run sh -c "umask 077 && cat >data/$file" <"$certificates/$file"
done
run sh -c 'cat - data/pg_hba.conf >pg_hba.conf && cp pg_hba.conf data/pg_hba.conf' <<RULES
hostssl all $sworn 127.0.0.1/32 trust clientcert=verify-ca
host all $sworn 127.0.0.1/32 reject
RULES

# A free port: the server is started on one after another until it has one.
port=
for _ in $(seq 20); do
    port=$((20000 + RANDOM % 12000))
    start "$port" && break
    end INT
    port=
done
[[ -n $port ]] || missing "it does not start: $(tail -n 1 "$folder/server.log")"
run "$bin/createuser" -h "$folder" -p "$port" -U feedwave --superuser "$sworn"

# Crashes it and starts it again, for tests that want to see that.
{
    echo '#!/usr/bin/env bash'
    echo 'set -euo pipefail'
    declare -p bin libraries folder port as
    declare -f runs start end
    echo 'end QUIT && start "$port"'
} >"$folder/restart"

# Drops the database of a name, whoever uses it.
{
    echo '#!/usr/bin/env bash'
    declare -p bin libraries folder port
    echo 'exec env LD_LIBRARY_PATH="$libraries" "$bin/dropdb" --if-exists --force -h "$folder" -p "$port" -U feedwave "$1"'
} >"$folder/drop"
chmod +x "$folder/restart" "$folder/drop"

export FEEDWAVE_TEST_STORE="postgres://feedwave@127.0.0.1:$port/{}?connections=6"
export FEEDWAVE_TEST_POSTGRES_RESTART=$folder/restart
export FEEDWAVE_TEST_POSTGRES_DROP=$folder/drop
begun=yes
echo "PostgreSQL $(run "$bin/postgres" --version | awk '{ print $3 }') on port $port, process $(cat "$folder/pid")"
if [[ $# -gt 0 ]]; then
    "$@"
else
    cargo test --workspace --test suite
    cargo test --workspace --test postgres_server --test end_to_end -- --include-ignored --skip exclusive:: --skip documents:: --skip mqtt::
    cargo test --workspace --test faults -- replicas:: --ignored --nocapture --test-threads 1
fi
