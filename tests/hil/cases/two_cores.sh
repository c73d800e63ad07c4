#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: on two CPUs the control thread has its core and priority, and processes that come and go in any order leave the executive alone.
# Method: `control.cpu: 1`, 200 Hz, for an emulated processor is slow; policy host and monitor are killed at once and restarted while the
#   executive runs. The second monitor finds ticks that are older than the keyframes that the executive still has. Real pace: nothing
#   is armed, no time is judged, and systemd's watchdog is off, since a busy host may stall.
# Mode: paced
# Replay: partly
# Limit: 900 s
# Planted fault: `cpu: none` in the file: the control thread may run anywhere.
# Planted by: s/cpu: none\/  cpu: 1/cpu: none\/  cpu: none/
. "$HIL_LIB/hil.sh"
drop_in takt-executive.service Service WatchdogSec=0
for unit in $POLICY takt-monitor; do drop_in $unit.service Service RestartSec=100ms; done
can_up vcan0 vcan1
robot arm6 's/^  cpu: none/  cpu: 1/' 's/^  (period|step): 1 ms/  \1: 5 ms/'
plant
takt_up
pid=$(main_pid takt-executive)
control=$(grep -l takt-control /proc/"$pid"/task/*/comm | cut -d/ -f5)
[ -n "$control" ] || fail "no control thread"
chrt -p "$control"
chrt -p "$control" | grep -q 'priority: 80' || fail "not the priority of the robot file"
grep -q '^Cpus_allowed_list:.1$' "/proc/$pid/task/$control/status" || fail "not on core 1: $(grep Cpus_allowed_list "/proc/$pid/task/$control/status")"

kill -KILL "$(main_pid $POLICY)" "$(main_pid takt-monitor)"
within 10 "policy host restarted" restarts_are $POLICY 1
within 10 "monitor restarted" restarts_are takt-monitor 1
[ "$(main_pid takt-executive)" = "$pid" ] || fail "another executive"
within 10 "the policy host is heard" eval '[ "$(field policy_pid)" = "$(main_pid $POLICY)" ]'
mode_is standby || fail "mode $(field mode)"
systemctl stop takt-monitor || fail "the second monitor does not end"
