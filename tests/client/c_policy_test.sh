#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Goal: takt/client.h is C11 without a warning, what is installed is all that a C policy needs, and `takt run` starts it. Method:
# the installation is staged, the example is built against it alone by gcc, is refused a robot file that does not fit it, and
# drives the demo robot for two seconds; the last joint must have moved. Usage: c_policy_test.sh SOURCE_DIR BUILD_DIR
set -euo pipefail
source=$1 build=$2
folder=$(mktemp -d "${TMPDIR:-/tmp}/takt-c-policy.XXXXXX")
trap 'rm -rf "$folder"' EXIT
cmake --install "$build" --component dev --prefix "$folder/stage" >/dev/null
# The library itself is in the package of the programs; as that is not staged whole, it comes from the build.
gcc -std=c11 -Wall -Wextra -Wpedantic -Wconversion -Werror -I"$folder/stage/include" \
  "$folder/stage/share/doc/takt-dev/examples/c-policy/sway.c" -L"$build/lib" -Wl,-rpath,"$build/lib" -ltakt-client -lm -o "$folder/sway"
nm -D --defined-only "$build/lib/libtakt-client.so" | awk '$3 !~ /^(takt_|TAKT_CLIENT_)/ { print "seen from outside: " $3; bad = 1 } END { exit bad }'

said=$("$folder/sway" --robot "$source/config/arm6.yaml" 2>&1) && { echo "was not refused"; exit 1; } || code=$?
[ "$code" = 65 ] && [[ "$said" == *"lists sensor target, which the policy does not read"* ]] || { echo "$code: $said"; exit 1; }

sed -e '/term: sensor/d' -e 's|arm6_reach.onnx|sway|' -e 's/drive_watchdog: .*/drive_watchdog: 500 ms/' -e 's/timeout: 20 ms/timeout: 200 ms/' \
  "$source/config/arm6.yaml" >"$folder/robot.yaml"
cd "$folder"
XDG_RUNTIME_DIR=$folder "$build/bin/takt" run robot.yaml --policy-host ./sway --arm --duration 2s --run-dir run "--plant=--truth=$folder/truth.jsonl"
grep -q tracking run/transitions.jsonl
python3 - <<'PYTHON'
import json
angles = [json.loads(line)["q"][5] for line in open("truth.jsonl") if line.endswith("}\n")]
assert max(angles) - min(angles) > 0.02, "the last joint did not move"
PYTHON
