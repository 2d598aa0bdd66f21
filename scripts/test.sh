#!/usr/bin/env bash
# Everything a change must pass: format, lint, types, import contract, tests. Arguments go to pytest.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/setup.sh --browser
PATH="$PWD/.venv/bin:${PATH:-/usr/bin:/bin}"
export PATH

ruff check --quiet
ruff format --check --quiet
ty check --quiet
lint-imports --no-logo --no-cache >/dev/null || lint-imports --no-logo --no-cache # once more to say what is wrong
exec python -m pytest -q -n auto "$@"
