#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: a recorded log that canplayer plays back feeds a listening executive like drives would.
# Method: record both buses for two seconds while the plant answers in standby; end the plant: feedback is lost. Play only the drives' replies: the
#   executive hears every joint as long as the log lasts, and loses them after it.
# Mode: virtual
# Limit: 90 s
# Planted fault: the log without joint 4's replies: feedback stays lost.
# Planted by: s/^canplayer -I replies.log/grep -v ' 014#' replies.log >most.log; canplayer -I most.log/
. "$HIL_LIB/hil.sh"
can_up vcan0 vcan1
robot arm6
plant
takt_up
candump -L -T 200 -n 30000 vcan0 vcan1 >all.log &
sleep 2
kill $!
grep -E ' 01[0-9A-F]#| 000#' all.log >replies.log
say "$(wc -l <replies.log) replies recorded"
systemctl stop $PLANT
within 3 "silence" active_cause feedback_lost
canplayer -I replies.log &
player=$!
within 1.5 "joints heard from the log" no_active_cause feedback_lost
wait $player
within 3 "silence after the log" active_cause feedback_lost
