#!/usr/bin/env bash
# Builds the image and runs it as compose.yaml says, then proves: it becomes healthy; nothing of it runs as root, has a
# capability or can write outside its volume; a job goes through it; SIGTERM ends it in order, with a stream open that
# nobody reads; the job is still there after a restart; under mutual TLS with a private authority, as compose.tls.yaml says,
# it becomes healthy by the probe's own certificate and serves clients with one, and no others.
#
# Needs the Rust toolchain and Python 3; installs buildah, podman and runc with apt-get where they are missing. Images,
# volumes and settings of the engine live in a directory of their own, which is removed at the end. Works without systemd
# and inside containers.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

readonly podman_compose_version=1.6.0
readonly start_attempts=600 # of 0.1 s

fail() {
    echo "FAILED: $*" >&2
    exit 1
}
say() { printf '%s\n' "--- $*"; }

missing=()
for tool in buildah podman runc curl openssl; do
    command -v "$tool" >/dev/null || missing+=("$tool")
done
if ((${#missing[@]} > 0)); then
    apt-get update -qq
    DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi

work=$(mktemp -d)
mkdir "$work/home"
# Engine settings that need neither systemd nor user namespaces, for this script alone.
cat >"$work/storage.conf" <<CONF
[storage]
driver = "vfs"
graphroot = "$work/storage"
runroot = "$work/run"
CONF
cat >"$work/containers.conf" <<'CONF'
[engine]
runtime = "runc"
cgroup_manager = "cgroupfs"
events_logger = "file"
CONF
export CONTAINERS_STORAGE_CONF=$work/storage.conf CONTAINERS_CONF=$work/containers.conf BUILDAH_ISOLATION=chroot
# Where the host's own limits are lower than the engine's defaults, containers do not start with the latter.
printf 'services:\n  feedwave:\n    ulimits: {nofile: 4096, nproc: 4096}\n' >"$work/limits.yaml"

python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check "podman-compose==$podman_compose_version"
# Without systemd the engine cannot schedule health checks and complains at every step; they are run by hand here.
compose_files=(-f deploy/compose.yaml -f "$work/limits.yaml")
compose() {
    PATH="$work/venv/bin:$PATH" podman-compose --no-ansi "${compose_files[@]}" "$@" 2> >(grep -v 'systemd' >&2)
}
container=feedwave_feedwave_1
client_pid=
clean_up() {
    status=$?
    [[ -z $client_pid ]] || kill "$client_pid" 2>/dev/null || true
    [[ $status -eq 0 ]] || podman logs "$container" 2>&1 | tail -n 50 >&2 || true
    compose down --volumes >/dev/null 2>&1 || true
    rm -rf "$work"
}
trap clean_up EXIT

say "build"
deploy/build-image.sh localhost/feedwave:latest
binary=${CARGO_TARGET_DIR:-target}/$(rustc -vV | sed -n 's/^host: //p')/release/feedwave
if ldd "$binary" 2>&1 | grep -q '=>'; then fail "the binary is not static: $(ldd "$binary")"; fi
say "image: $(podman image inspect localhost/feedwave:latest --format '{{.Size}}') bytes"

wait_until_healthy() {
    for ((attempt = 0; attempt < start_attempts; attempt++)); do
        podman healthcheck run "$container" >/dev/null 2>&1 && return
        sleep 0.1
    done
    fail "never healthy"
}
milliseconds() { echo $(($(date +%s%N) / 1000000)); }

say "start"
compose up -d >/dev/null
begun=$(milliseconds)
wait_until_healthy
say "healthy $(($(milliseconds) - begun)) ms after the engine had started it"
ready=$(podman logs "$container" 2>&1 | grep -c '"ready"') || fail "the log does not say that it is ready"
((ready == 1)) || fail "the log says $ready times that it is ready"

say "confinement"
pid=$(podman inspect "$container" --format '{{.State.Pid}}')
status_of() { sed -n "s/^$1:[[:space:]]*//p" "/proc/$pid/status"; }
[[ $(status_of NSpid | awk '{print $NF}') == 1 ]] || fail "it is not process 1 of its container"
[[ $(status_of Uid) == $'65532\t65532\t65532\t65532' ]] || fail "it runs as user $(status_of Uid)"
[[ $(status_of CapEff) == 0000000000000000 ]] || fail "it has capabilities: $(status_of CapEff)"
[[ $(status_of NoNewPrivs) == 1 ]] || fail "it could gain privileges"
awk '$5 == "/" { exit ($6 ~ /(^|,)ro(,|$)/) ? 0 : 1 }' "/proc/$pid/mountinfo" || fail "its root can be written"
awk '$5 == "/var/lib/feedwave" { found = ($6 ~ /(^|,)rw(,|$)/) } END { exit !found }' "/proc/$pid/mountinfo" ||
    fail "its volume is not mounted for writing"

say "a job"
cat >"$work/shaft.nc" <<'NC'
M3 S1000
G0 X6. Z10.
G200 F41.667 A0.03
G1 X10. Z20. F0.05
G2 X14. Z23.5 R4.
G201
M30
NC
export FEEDWAVE_SERVER=http://127.0.0.1:50051
"$binary" submit "$work/shaft.nc" --request-id image-test --wait
job=$("$binary" submit "$work/shaft.nc" --request-id image-test)
"$binary" stream "$job" --out "$work/before.csv"
(($(wc -l <"$work/before.csv") > 15000)) || fail "too few setpoints"
curl -fsS "http://127.0.0.1:8080/v1/$job" | grep -q JOB_STATE_READY || fail "the HTTP port does not know $job"
curl -fsS http://127.0.0.1:8080/readyz >/dev/null

say "SIGTERM with a stream open that nobody reads"
printf 'G0 X10. Z1.\nG4 P2000000\nM30\n' >"$work/dwell.nc"
"$binary" submit "$work/dwell.nc" --request-id image-test-dwell --wait >/dev/null
# Into a pipe that nobody reads, so that the stream stays open.
mkfifo "$work/unread"
exec 3<>"$work/unread"
"$binary" stream "$("$binary" submit "$work/dwell.nc" --request-id image-test-dwell)" >&3 2>/dev/null &
client_pid=$!
for ((attempt = 0; attempt < start_attempts; attempt++)); do
    curl -fsS http://127.0.0.1:8080/metrics | grep -q '^feedwave_active_streams 1$' && break
    sleep 0.1
done
((attempt < start_attempts)) || fail "the stream never opens"
begun=$(milliseconds)
compose stop >/dev/null
say "ended $(($(milliseconds) - begun)) ms after SIGTERM"
exit_code=$(podman inspect "$container" --format '{{.State.ExitCode}}')
[[ $exit_code == 0 ]] || fail "exit code $exit_code after SIGTERM"
kill "$client_pid" 2>/dev/null || true
client_pid=
exec 3>&-

say "restart"
compose start >/dev/null
wait_until_healthy
[[ $("$binary" submit "$work/shaft.nc" --request-id image-test) == "$job" ]] || fail "the job is forgotten"
"$binary" stream "$job" --out "$work/after.csv"
cmp "$work/before.csv" "$work/after.csv" || fail "the setpoints are others after the restart"

say "mutual TLS with a private authority"
export FEEDWAVE_TLS_DIRECTORY=$work/tls FEEDWAVE_TLS_DOMAIN=feedwave.plant
mkdir "$FEEDWAVE_TLS_DIRECTORY"
in_tls() { (cd "$FEEDWAVE_TLS_DIRECTORY" && openssl "$@" 2>/dev/null); }
in_tls req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj "/CN=plant authority" \
    -keyout ca-key.pem -out ca.pem
for holder in server probe; do
    in_tls req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj "/CN=$holder" -keyout "$holder-key.pem" -out "$holder.csr"
    # The server's name is in its certificate, no address is; the probe's is good for clients only.
    [[ $holder == server ]] && usage=serverAuth || usage=clientAuth
    printf 'subjectAltName=DNS:%s\nextendedKeyUsage=%s\n' "$FEEDWAVE_TLS_DOMAIN" "$usage" >"$work/extensions"
    in_tls x509 -req -in "$holder.csr" -CA ca.pem -CAkey ca-key.pem -CAcreateserial -days 2 -extfile "$work/extensions" \
        -out "$holder.pem"
done
rm "$FEEDWAVE_TLS_DIRECTORY/ca-key.pem"
# The work directory is its owner's alone; what the container reads is the service's.
chmod 0711 "$work"
chown -R 65532:65532 "$FEEDWAVE_TLS_DIRECTORY"
compose down >/dev/null 2>&1
compose_files+=(-f deploy/compose.tls.yaml)
compose up -d >/dev/null
wait_until_healthy
tls_client() { "$binary" submit "$work/shaft.nc" --request-id image-test --server https://127.0.0.1:50051 --domain feedwave.plant "$@"; }
[[ $(tls_client --ca "$FEEDWAVE_TLS_DIRECTORY/ca.pem" --cert "$FEEDWAVE_TLS_DIRECTORY/probe.pem" --key "$FEEDWAVE_TLS_DIRECTORY/probe-key.pem") == "$job" ]] ||
    fail "a client with a certificate is not served"
if tls_client --ca "$FEEDWAVE_TLS_DIRECTORY/ca.pem" >/dev/null 2>&1; then fail "a client without a certificate is served"; fi
# A probe that finds no certificate says so instead of being healthy.
if podman exec -e FEEDWAVE_HEALTHCHECK__CA=/etc/feedwave/tls/probe.pem "$container" /feedwave healthcheck 2>/dev/null; then
    fail "the probe trusts any authority"
fi

say "passed"
