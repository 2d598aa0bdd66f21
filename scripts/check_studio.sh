#!/usr/bin/env bash
# Build the studio's page anew, in a folder of its own, and compare: exit 0 if web/built has the same bytes, 1 if not,
# 3 if it cannot be built here (no Node, or its packages cannot be fetched).
set -euo pipefail
web=$(cd "$(dirname "$0")/../src/prelight/studio/web" && pwd)
cannot() { printf 'check_studio: %s\n' "$*" >&2; exit 3; }

command -v npm >/dev/null || cannot "npm is not installed"
node -e 'const [a, b] = process.versions.node.split("."); process.exit(a > 20 || (a == 20 && b >= 19) ? 0 : 1)' ||
    cannot "Node $(node --version) is too old; 20.19 or newer is needed"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cp -R "$web/source" "$web"/package.json "$web"/package-lock.json "$web"/tsconfig.json "$web"/vite.config.js \
    "$web"/.npmrc "$folder"
cd "$folder"
npm ci --no-audit --no-fund --prefer-offline --fetch-retries=1 --loglevel=error >npm.log 2>&1 ||
    cannot "the page's packages cannot be fetched: $(tail -n 1 npm.log)"
npm run --silent build >build.log 2>&1 || { cat build.log >&2; exit 1; }
diff -r "$web/built" "$folder/built" >&2 || {
    printf 'check_studio: web/built is not what its sources give; run scripts/build_studio.sh and commit it\n' >&2
    exit 1
}
