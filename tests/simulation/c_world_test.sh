#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Goal: takt/world.h is C11 without a warning and what is installed is all that a C world needs; a world that is killed ends the plant
# with its name; what the world cannot do is refused before anything starts. Method: the installation is staged, the example is built
# against it alone by gcc and plays the demo arm for takt-plant in real time, until it is killed. Usage: c_world_test.sh SOURCE_DIR BUILD_DIR
set -euo pipefail
source=$1 build=$2
folder=$(mktemp -d "${TMPDIR:-/tmp}/takt-c-world.XXXXXX")
world=
trap '[ -z "$world" ] || kill -9 $world 2>/dev/null; rm -rf "$folder"' EXIT
fail() { echo "$*" >&2; exit 1; }

cmake --install "$build" --component dev --prefix "$folder/stage" >/dev/null
examples=$folder/stage/share/doc/takt-dev/examples
[ -f "$examples/world/takt-world.mjs" ] || fail "takt-world.mjs is not installed"
gcc -std=c11 -Wall -Wextra -Wpedantic -Wconversion -Werror -I"$folder/stage/include" "$examples/c-world/flywheels.c" -lm -o "$folder/flywheels"

plant() { timeout 60 "$build/bin/takt-plant" --robot "$source/config/arm6.yaml" --runtime-dir "$folder/run" --world "$folder/world.sock" "$@" 2>&1; }
mkdir "$folder/run"
printf 'schema: takt.scenario/1\nevents:\n  - { at: 1 s, push: 10 N, along: [1, 0, 0] }\n' >"$folder/push.yaml"

"$folder/flywheels" "$folder/world.sock" &
world=$!
said=$(plant --scenario "$folder/push.yaml") && fail "a push was taken" || code=$?
[ "$code" = 65 ] && [[ "$said" == *"is not for --world"* ]] || fail "$code: $said"
plant --truth "$folder/truth.jsonl" >"$folder/said" & simulation=$!
# The truth is flushed once a second.
for ((i = 0; i < 600; ++i)); do [ "$(cat "$folder/truth.jsonl" 2>/dev/null | wc -l)" -gt 20 ] && break; sleep 0.05; done
kill -9 $world
wait $world 2>/dev/null || true
world=
wait $simulation && fail "did not notice" || code=$?
[ "$code" = 69 ] || fail "exit code $code: $(cat "$folder/said")"
grep -q "world.sock (flywheels), over shared memory" "$folder/said" || fail "$(cat "$folder/said")"
grep -q "world.sock (flywheels): went away before it answered question" "$folder/said" || fail "$(cat "$folder/said")"
python3 - "$folder/truth.jsonl" <<'PYTHON'
import json, sys
poses = [json.loads(line)["q"] for line in open(sys.argv[1]) if line.endswith("}\n")]
assert len(poses) > 20, len(poses)
apart = max(abs(q - home) for pose in poses for q, home in zip(pose, [0, 0.6, -1.2, 0, 0.6, 0]))
assert apart < 1e-3, f"the brakes did not hold: {apart} rad"
PYTHON
