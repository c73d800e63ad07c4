#!/bin/sh
# SPDX-License-Identifier: Apache-2.0
# page_sql.sh PAGE.md MAKE_RECORDED_DEMO MAKE_SAMPLE_ARTIFACT TAKT: runs the page's SQL on a recorded run, the table that the
# page's own Python makes of it, the data set that it is exported to, and an artifact. Skips (77) without node, its packages, or Python's; TAKT_REQUIRE_NODE=1
# makes that a failure.
root=$(cd "$(dirname "$0")/../.." && pwd)
page=$(realpath "$1")
skip() {
  echo "SKIPPED: $1" >&2
  [ "$TAKT_REQUIRE_NODE" = 1 ] && exit 1
  exit 77
}
command -v node >/dev/null || skip "node is not installed"
[ -d "$root/tests/node/node_modules" ] || skip "npm packages are missing: (cd tests/node && npm install)"
/usr/bin/python3 -c 'import pandas, zstandard' 2>/dev/null || skip "python3-pandas or python3-zstandard is not installed"
folder=$(mktemp -d) || exit 1
trap 'rm -rf "$folder"' EXIT
cd "$root" && "$2" "$folder/run" && "$3" "$folder/panel" >/dev/null || exit 1
cd "$folder" || exit 1
sed -n '/^```python with_pandas.py$/,/^```$/p' "$page" | sed '1d;$d' >with_pandas.py
PYTHONPATH=$root/client/python /usr/bin/python3 with_pandas.py >/dev/null || exit 1
"$4" export lerobot run --out arm6_set >/dev/null || exit 1
node "$root/tests/node/page_sql.mjs" "$page" "$folder"
