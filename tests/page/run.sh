#!/usr/bin/env bash
# Opens every screen of the page in a real browser, against a real service with a live run on a simulated machine: what is shown
# is what the service says, nothing is asked of another host, nothing that a keyboard or a screen reader lacks. The documents of the MTConnect
# agent are held against the schemas of the standard at the same time, and read by a client of the standard from PyPI. The extension of VS Code,
# for which npm is needed as well, is checked and packed before (.ci/extension).
#
#   tests/page/run.sh [BINARY]     default: the release build
#
# Needs Node.js, Python 3 and Debian's chromium and libxml2-utils, which are installed where they are not there and apt may do so. Packages of npm and the screenshots
# (target/ci/page/screenshots) go into the target directory.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(cd "$here/../.." && pwd)
target=${CARGO_TARGET_DIR:-$root/target}
scratch=$target/ci/page
readonly packages=(playwright-core@1.65.1 axe-core@4.14.1)
# A client of MTConnect that others have written.
readonly standard_client=pymtconnect==1.0.1

missing() {
    echo "the page cannot be looked at: $1" >&2
    exit 1
}

"$root/.ci/extension"

binary=${1:-}
if [[ -z $binary ]]; then
    cargo build --release --bin feedwave --manifest-path "$root/Cargo.toml"
    binary=$target/release/feedwave
fi

mkdir -p "$scratch"
browser=${CHROMIUM:-$(command -v chromium || true)}
if [[ -z $browser ]] || ! command -v xmllint >/dev/null; then
    command -v apt-get >/dev/null || missing "there is no chromium (CHROMIUM names one) or no xmllint"
    (apt-get update && apt-get install --yes --no-install-recommends chromium fonts-dejavu-core libxml2-utils) >"$scratch/apt.log" 2>&1 ||
        missing "chromium and libxml2-utils cannot be installed: $(tail -n 1 "$scratch/apt.log")"
    browser=${browser:-$(command -v chromium)}
fi

if [[ $(cat "$scratch/packages" 2>/dev/null) != "${packages[*]}" ]]; then
    rm -rf "$scratch/node_modules"
    npm install --silent --no-audit --no-fund --no-save --ignore-scripts --prefix "$scratch" "${packages[@]}" ||
        missing "npm cannot install ${packages[*]}"
    echo "${packages[*]}" >"$scratch/packages"
fi

python=$scratch/python
if [[ $(cat "$python/packages" 2>/dev/null) != "$standard_client" ]]; then
    rm -rf "$python"
    python3 -m venv "$python"
    "$python/bin/pip" install --quiet --disable-pip-version-check "$standard_client" || missing "pip cannot install $standard_client"
    echo "$standard_client" >"$python/packages"
fi

rm -rf "$scratch/screenshots" "$scratch/service"
mkdir -p "$scratch/screenshots" "$scratch/service"
# Beside the packages, where Node.js looks for them.
cp "$here"/*.mjs "$here"/*.nc "$here"/*.py "$scratch"
cp "$root/tests/fixtures/turning-demo.nc" "$scratch/shaft.nc"
cp "$root/tests/fixtures/thread-a.nc" "$scratch/thread.nc"
PYTHON=$python/bin/python FEEDWAVE_BINARY=$(realpath "$binary") SCHEMAS=$root/tests/fixtures/mtconnect CHROMIUM=$browser timeout --foreground 240 node "$scratch/page.mjs" "$scratch"
