#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: no frame that carries a policy's command is on the bus when that command's oldest sample is older than max_age.
# Method: arm6 tracking, while its policy host and its executive are paused, for up to twice max_age. A peer on the bus stamps every frame (candump,
#   the kernel's clock); age_on_wire.py then finds for each frame the tick it came from, and so the command's oldest sample.
# Mode: virtual
# Limit: 90 s
# Planted fault: the bus keeps our frames for 8 ms before its peers see them.
# Planted by: /^candump/i tc qdisc add dev vcan0 root netem delay 8ms
. "$HIL_LIB/hil.sh"
tracking_arm6
candump -L vcan0 vcan1 >frames.log &
dump=$!
# paused SECONDS UNIT: one of the robot's processes stands still meanwhile.
paused() {
  local pid
  pid=$(main_pid "$2")
  kill -STOP "$pid"
  sleep "$1"
  kill -CONT "$pid"
  sleep 1
  mode_is tracking || mode_is degraded || recover
}
for seconds in 0.06 0.09 0.12 0.15 0.3; do paused $seconds $POLICY; done
# Its unit's watchdog is fed every 250 ms, and bites after 500.
for seconds in 0.06 0.09 0.12 0.15 0.2; do paused $seconds takt-executive; done
restarts_are takt-executive 0 || fail "the executive was restarted"
kill $dump
say "$(transitions tracking degraded command_late) times degraded, $(wc -l <frames.log) frames"
