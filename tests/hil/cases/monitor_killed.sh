#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: a robot whose monitor dies stops, without a late period; the monitor is restarted, records into a folder of its own, and to the last stop.
# Method: SIGKILL to the monitor while tracking: a damped stop for recording_lost. Reset and armed again once another monitor writes. Then the whole target
#   is stopped: the second run must hold the damped stop. Both recordings are handed to the host, which replays them.
# Mode: virtual
# Replay: partly
# Limit: 90 s
# Planted fault: `Restart=no` in the unit: no second folder.
# Planted by: /^tracking_arm6/i drop_in takt-monitor.service Service Restart=no
. "$HIL_LIB/hil.sh"
tracking_arm6
sleep 1
kill -KILL "$(main_pid takt-monitor)"
within 2 "damped stop" mode_is damped_stop
journalctl -u takt-executive -o cat | grep -q "tracking -> damped_stop: recording_lost" || fail "stopped for another reason"
within 10 "monitor restarted" restarts_are takt-monitor 1
no_overrun_in 1000 "without and with another monitor"
within 10 "reset" was_reset
tracking
within 5 "second run folder" eval '[ "$(ls /var/lib/takt/runs | wc -l)" = 2 ]'
systemctl stop takt.target
within 20 "the monitor ended" eval '! is_active takt-monitor && ! is_active takt-executive'
newest=$(ls -d /var/lib/takt/runs/* | tail -1)
grep -q '"to":"damped_stop","cause":"shutdown"' "$newest/transitions.jsonl" || fail "the stop is not recorded: $(cat "$newest/transitions.jsonl")"
grep -q '"ended_because": "executive ended"' "$newest/manifest.json" || fail "$(grep ended_because "$newest/manifest.json")"
say "the stop of the whole target is in the run"
