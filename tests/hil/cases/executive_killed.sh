#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: an executive that is killed leaves a robot that stands, and comes back disarmed.
# Method: SIGKILL while tracking. What then is on the buses: ExecStopPost's disable frames (the MIT protocol's FF..FD); the drives' own
#   watchdogs (100 ms) are the plant's. The truth file says when the joints stood. systemd restarts the executive in standby.
# Mode: virtual
# Limit: 90 s
# Planted fault: without ExecStopPost no disable frame is seen.
# Planted by: /^can_up/i drop_in takt-executive.service Service ExecStopPost=
. "$HIL_LIB/hil.sh"
can_up vcan0 vcan1
robot arm6
plant --truth $RUN/truth.jsonl
takt_up
tracking
sleep 1
candump -L vcan0 vcan1 >frames.log &
candump=$!
sleep 0.3
kill -KILL "$(main_pid takt-executive)"
sleep 0.8 # less than RestartSec: the next executive sends disable frames too
kill $candump
for joint in 1 2 3 4 5 6; do
  grep -q " 00$joint#FFFFFFFFFFFFFFFD" frames.log || fail "no disable frame for joint $joint"
done
say "every drive was told to be disabled"
within 10 "executive restarted" restarts_are takt-executive 1
within 5 "standby" mode_is standby
[ "$(field drives_enabled)" = false ] || fail "the executive came back with drives enabled"
sleep 1
cp $RUN/truth.jsonl .
fastest=$(tail -20 truth.jsonl | grep '}$' | sed 's/.*"dq":\[\([^]]*\)\].*/\1/' | tr , '\n' |
  awk '{ speed = $1 < 0 ? -$1 : $1; if (speed > most) most = speed } END { print most }')
say "fastest joint afterwards: $fastest rad/s"
holds "$fastest < 0.05" || fail "the robot still moves"
within 10 "policy host attached again" takt arm --runtime-dir $RUN
within 5 "tracking" mode_is tracking
