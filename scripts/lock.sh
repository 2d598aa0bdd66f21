#!/usr/bin/env bash
# Rewrite requirements.lock from pyproject.toml (needs uv). The lock names no server: see docs/decisions/0001.
set -euo pipefail
cd "$(dirname "$0")/.."
exec uv pip compile --quiet --no-config --universal --python-version 3.11 --fork-strategy fewest \
    --extra bake --group dev --generate-hashes --no-header --no-emit-index-url \
    --output-file requirements.lock "$@" pyproject.toml
