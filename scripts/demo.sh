#!/usr/bin/env bash
# From nothing to pictures: set up, bake the built-in scene, relight it. Options go to `prelight demo`.
set -euo pipefail
scripts=$(cd "$(dirname "$0")" && pwd)
bash "$scripts/setup.sh"
exec "$scripts/../.venv/bin/prelight" demo "$@"
