#!/usr/bin/env bash
# Build the studio's page: src/prelight/studio/web/source -> web/built, which is committed. Needs Node 20.19 or newer.
set -euo pipefail
cd "$(dirname "$0")/../src/prelight/studio/web"
npm ci --no-audit --no-fund --prefer-offline --loglevel=error
npm run --silent build
