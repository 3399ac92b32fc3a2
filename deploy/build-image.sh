#!/usr/bin/env bash
# Builds the static binary and the container image.
#
#   deploy/build-image.sh [TAG]     default: localhost/feedwave:latest
#
# Needs the Rust toolchain and buildah, podman or docker; pulls no image.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

tag=${1:-localhost/feedwave:latest}
host=$(rustc -vV | sed -n 's/^host: //p')
target_dir=${CARGO_TARGET_DIR:-$PWD/target}

revision=$(git rev-parse HEAD 2>/dev/null || true)

# The target is named, so that `+crt-static` reaches the service and not the compiler's own plug-ins.
FEEDWAVE_REVISION=$revision RUSTFLAGS="-C target-feature=+crt-static" \
    cargo build --release --locked --bin feedwave --target "$host"

context=$(mktemp -d)
trap 'rm -rf "$context"' EXIT
install "$target_dir/$host/release/feedwave" "$context/feedwave"
mkdir "$context/data"

labels=(
    --label "org.opencontainers.image.version=$("$context/feedwave" --version | cut -d' ' -f2)"
    --label "org.opencontainers.image.revision=$revision"
)
if command -v buildah >/dev/null; then
    buildah bud --format docker "${labels[@]}" -f deploy/Containerfile -t "$tag" "$context"
elif command -v podman >/dev/null; then
    podman build --format docker "${labels[@]}" -f deploy/Containerfile -t "$tag" "$context"
else
    docker build "${labels[@]}" -f deploy/Containerfile -t "$tag" "$context"
fi
