#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Goal: `takt run` drives the demo robot over SocketCAN interfaces of the machine that it runs on, without a guest.
# Method: two vcan interfaces of its own names, arm6 on them, two seconds of tracking with all processes; the run must say that the buses were
#   SocketCAN, hold frames of both, and replay bit for bit. No time is judged: the machine may be anything.
# Usage: native.sh PROGRAMS_FOLDER ROBOTS_FOLDER     needs root
# Exit codes: 0 passed, 1 failed, 69 this machine has no vcan.
set -uo pipefail
programs=$1 robots=$2
interfaces=(takthil0 takthil1)
work=$(mktemp -d "${TMPDIR:-/tmp}/takt-native.XXXXXX")

clean() {
  for interface in "${interfaces[@]}"; do ip link del "$interface" 2>/dev/null; done
  rm -rf "$work"
}
trap clean EXIT
fail() {
  echo "FAIL: $*"
  tail -20 "$work/run.txt" 2>/dev/null
  exit 1
}

modprobe -q vcan 2>/dev/null
for interface in "${interfaces[@]}"; do
  ip link add dev "$interface" type vcan 2>"$work/link.txt" && ip link set "$interface" up || {
    echo "native: this machine has no vcan ($(tail -1 "$work/link.txt")): nothing was run; load the module vcan, or use ./dev hil" >&2
    exit 69
  }
done
sed -E -e "s/interface: can/interface: takthil/; s/when_missing: loopback/when_missing: refuse/; s/^  cpu: 1 .*/  cpu: none/" \
  "$robots/arm6.yaml" >"$work/arm6.yaml"
cp "$robots"/*.onnx "$work/"
timeout 120 "$programs/takt" run "$work/arm6.yaml" --runtime-dir "$work/runtime" --run-dir "$work/run" --arm --duration 2s \
  --allow-non-realtime >"$work/run.txt" 2>&1 || [ $? -eq 2 ] || fail "takt run failed" # 2: a stop that a slow machine brings
grep -q '"to":"tracking"' "$work/run/transitions.jsonl" || fail "it never tracked"
grep -q 'takthil0: SocketCAN' "$work/run/manifest.json" || fail "the run does not name SocketCAN: $(grep -o '"bus[^]]*]' "$work/run/manifest.json")"
for interface in "${interfaces[@]}"; do
  zstd -dc "$work/run/can.log.zst" | grep " $interface " >/dev/null || fail "no frame of $interface in can.log.zst"
done
timeout 120 "$programs/takt" replay "$work/run" || [ $? -eq 2 ] || fail "the run does not replay"
