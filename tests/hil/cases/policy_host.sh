#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: a policy host that dies, hangs or sends invalid commands cannot move the robot, and systemd brings it back.
# Method: while tracking, SIGKILL to the policy host; SIGSTOP, then SIGCONT; then a liar in its place that sends NaN. Each time the robot
#   degrades or stops; after death and hang it is reset and armed, and tracks again. The age at which it degraded must not be far from max_age.
# Mode: virtual
# Limit: 120 s
# Planted fault: `Restart=no` in the unit: the host does not come back.
# Planted by: /^tracking_arm6/i drop_in $POLICY.service Service Restart=no
. "$HIL_LIB/hil.sh"
tracking_arm6

kill -KILL "$(main_pid $POLICY)"
within 5 "degraded after SIGKILL" happened tracking degraded command_late
age=$(age_at tracking degraded command_late)
say "killed: degraded at a command age of $age ms (max_age 150 ms)"
holds "$age > 150 && $age < 250" || fail "degraded at $age ms"
within 5 "damped stop" happened degraded damped_stop command_lost
within 10 "policy host restarted" restarts_are $POLICY 1
recover

kill -STOP "$(main_pid $POLICY)"
within 5 "damped stop of a robot without words" mode_is damped_stop
[ "$(transitions degraded damped_stop command_lost)" = 2 ] || fail "it should have degraded, then stopped: $(cat /var/lib/takt/runs/*/transitions.jsonl)"
kill -CONT "$(main_pid $POLICY)"
recover
is_active takt-executive && restarts_are takt-executive 0 || fail "the executive did not live through it"

systemctl stop $POLICY
within 5 "damped stop without policy host" mode_is damped_stop
within 10 "reset" was_reset
systemd-run --quiet --unit hil-rogue --uid takt-policy --gid takt -p RestrictAddressFamilies=AF_UNIX \
  "$HIL_LIB/tools/takt-rogue-policy" --robot $ROBOT --runtime-dir $RUN --behaviour nan --healthy-for '4 s'
tracking
within 10 "stop at not-a-number" stopped_by bad_commands
takt status --runtime-dir $RUN | grep -E 'not_finite|messages'
