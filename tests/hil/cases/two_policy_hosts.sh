#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: of two policy hosts one is heard; the other is refused and changes nothing.
# Method: a second takt-policy-host, by the same user, while the first steers; the executive keeps its peer, its mode and its accepted messages. When the
#   first ends, the second may have the robot.
# Mode: virtual
# Limit: 90 s
# Planted fault: killing the first before the check of the peer: another peer.
# Planted by: s/^sleep 2/systemctl stop $POLICY; sleep 2/
. "$HIL_LIB/hil.sh"
tracking_arm6
first=$(field policy_pid)
systemd-run --quiet --unit hil-second --uid takt-policy --gid takt takt-policy-host --robot $ROBOT --runtime-dir $RUN
sleep 2
[ "$(field policy_pid)" = "$first" ] || fail "the second policy host took over"
mode_is tracking || fail "mode $(field mode)"
is_active hil-second || fail "the second gave up: $(journalctl -u hil-second -o cat | tail -2)"
journalctl -u takt-executive -u hil-second -o cat | grep -iE 'refus|already|lease' | sort -u | head -3
systemctl stop $POLICY
within 10 "the second is heard" eval '[ "$(field policy_pid)" = "$(main_pid hil-second)" ]'
