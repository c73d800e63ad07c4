#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# run.sh CHECK.mjs MAKE_RECORDED_DEMO [TAKT]: records a run and lets a check written in JavaScript look at it. With TAKT
# the run also gets its report.html, compared with a second one.
# Without the npm packages (or, for the report, without Chromium) it skips, exit code 77, unless TAKT_REQUIRE_NODE=1.
here=$(cd "$(dirname "$0")" && pwd)
skip() {
  echo "SKIPPED: $1" >&2
  [ "$TAKT_REQUIRE_NODE" = 1 ] && exit 1
  exit 77
}
command -v node >/dev/null || skip "node is not installed"
[ -d "$here/node_modules" ] || skip "npm packages are missing: (cd tests/node && npm install)"
if [ -n "$3" ]; then
  TAKT_CHROMIUM=${TAKT_CHROMIUM:-$(command -v chromium)} || skip "chromium is not installed"
  export TAKT_CHROMIUM
fi
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
"$2" "$folder/run" || exit 1
if [ -n "$3" ]; then
  "$2" "$folder/other" && "$3" report "$folder/run" --against "$folder/other" >/dev/null || exit 1
fi
node "$here/$1" "$folder/run"
