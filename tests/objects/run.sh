#!/usr/bin/env bash
# Runs the end-to-end tests of large programs against servers that others have written, each on a free port of this machine and gone
# with this script: moto speaks the protocols of S3 and, but for tokens, of Google Cloud Storage, Azurite that of Azure Blob Storage.
#
#   tests/objects/run.sh [COMMAND]...
#
# The tests, or the command, find in FEEDWAVE_TEST_OBJECTS the URI of an object store with {} where the name of an empty prefix goes,
# and credentials in the environment. Needs Python 3 and npm, whose packages go into the target directory.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/../.."
scratch=${CARGO_TARGET_DIR:-$PWD/target}/ci/objects
readonly moto=('moto[s3,server]==5.2.5' azure-storage-blob==12.31.1)
readonly azurite=azurite@3.37.0
mkdir -p "$scratch"

missing() {
    echo "no object store can be had: $1" >&2
    exit 1
}

python=$scratch/python
if [[ $(cat "$python/packages" 2>/dev/null) != "${moto[*]}" ]]; then
    rm -rf "$python"
    python3 -m venv "$python"
    "$python/bin/pip" install --quiet --disable-pip-version-check "${moto[@]}" || missing "pip cannot install ${moto[*]}"
    echo "${moto[*]}" >"$python/packages"
fi
if [[ $(cat "$scratch/packages" 2>/dev/null) != "$azurite" ]]; then
    rm -rf "$scratch/node_modules"
    npm install --silent --no-audit --no-fund --no-save --ignore-scripts --prefix "$scratch" "$azurite" || missing "npm cannot install $azurite"
    echo "$azurite" >"$scratch/packages"
fi

folder=$(mktemp -d "${TMPDIR:-/tmp}/feedwave-objects.XXXXXX")
servers=()
finish() {
    local status=$?
    [[ $status -eq 0 ]] || tail -n 20 "$folder"/*.log >&2 || true
    for server in "${servers[@]}"; do
        kill "$server" 2>/dev/null && wait "$server" 2>/dev/null || true
    done
    rm -rf "$folder"
}
trap finish EXIT
trap 'exit 1' INT TERM HUP

# Starts a server (a function of a port) on one free port after another until it answers; the port is in `port`.
port=
started() {
    local _ __
    for _ in $(seq 20); do
        port=$((20000 + RANDOM % 12000))
        "$1" "$port" >"$folder/$1.log" 2>&1 &
        local server=$!
        for __ in $(seq 600); do
            kill -0 "$server" 2>/dev/null || break
            if (: <"/dev/tcp/127.0.0.1/$port") 2>/dev/null; then
                servers+=("$server")
                return 0
            fi
            sleep 0.1
        done
        kill "$server" 2>/dev/null || true
    done
    missing "$1 does not start: $(tail -n 1 "$folder/$1.log")"
}
s3() {
    exec "$python/bin/moto_server" -H 127.0.0.1 -p "$1"
}
azure() {
    exec node "$scratch/node_modules/azurite/dist/src/blob/main.js" --inMemoryPersistence --disableTelemetry --skipApiVersionCheck \
        --blobHost 127.0.0.1 --blobPort "$1"
}
# The XML protocol of Google Cloud Storage is that of S3 but for a bearer instead of a signature, of which moto knows nothing.
gs() {
    exec "$python/bin/python" - "$1" <<'PYTHON'
import sys

from moto.server import DomainDispatcherApplication, create_backend_app
from werkzeug.serving import run_simple

s3 = DomainDispatcherApplication(create_backend_app)


signed = "AWS4-HMAC-SHA256 Credential=feedwave/20260101/us-east-1/s3/aws4_request, SignedHeaders=host, Signature=0"


def with_signature(environ, start_response):
    environ["HTTP_AUTHORIZATION"] = signed
    return s3(environ, start_response)


run_simple("127.0.0.1", int(sys.argv[1]), with_signature, threaded=True)
PYTHON
}
tests() {
    if [[ $# -gt 0 ]]; then
        "$@"
    else
        cargo test --workspace --test end_to_end -- objects::
    fi
}

started s3
# Of no account: a key that must not be found in a log.
export AWS_ACCESS_KEY_ID=feedwave AWS_SECRET_ACCESS_KEY=not-to-be-found-in-any-log AWS_REGION=plant-1
"$python/bin/python" - "$port" <<'PYTHON'
import sys

import boto3

boto3.client("s3", endpoint_url=f"http://127.0.0.1:{sys.argv[1]}").create_bucket(
    Bucket="programs", CreateBucketConfiguration={"LocationConstraint": "eu-central-1"}
)
PYTHON
echo "S3 (moto) on port $port"
FEEDWAVE_TEST_OBJECTS="s3://programs/{}?endpoint=http://127.0.0.1:$port&allow_http=true" tests "$@"

started gs
curl --silent --show-error --fail --output /dev/null --request PUT "http://127.0.0.1:$port/programs"
# Of no account: nobody is asked for a token, and the bearer is empty.
export GOOGLE_SERVICE_ACCOUNT_KEY='{"disable_oauth": true, "client_email": "", "private_key": "", "private_key_id": ""}'
echo "Google Cloud Storage, its XML protocol (moto), on port $port"
FEEDWAVE_TEST_OBJECTS="gs://programs/{}?base_url=http://127.0.0.1:$port&allow_http=true" tests "$@"

started azure
# The account and the key that every Azurite has.
readonly account=devstoreaccount1
AZURE_STORAGE_ACCOUNT_KEY=$(grep -oEm1 '[A-Za-z0-9+/]{86}==' "$scratch/node_modules/azurite/dist/src/common/utils/constants.js" | head -n 1)
export AZURE_STORAGE_ACCOUNT_KEY
"$python/bin/python" - "$port" "$account" <<'PYTHON'
import os
import sys

from azure.storage.blob import BlobServiceClient

port, account = sys.argv[1:]
key = os.environ["AZURE_STORAGE_ACCOUNT_KEY"]
BlobServiceClient(f"http://127.0.0.1:{port}/{account}", credential=key).create_container("programs")
PYTHON
echo "Azure Blob Storage (Azurite) on port $port"
FEEDWAVE_TEST_OBJECTS="az://programs/{}?account_name=$account&endpoint=http://127.0.0.1:$port/$account&allow_http=true" tests "$@"
