#!/bin/bash
# Goal: the monitor's death does not touch the robot; it is restarted and records into a folder of its own.
# Method: SIGKILL to the monitor while tracking; the executive goes on without a late period, in the same mode. Both recordings are handed to the
#   host, which replays them.
# Mode: virtual
# Limit: 90 s
# Planted fault: `Restart=no` in the unit: no second folder.
# Planted by: /^tracking_arm6/i drop_in takt-monitor.service Service Restart=no
. "$HIL_LIB/hil.sh"
tracking_arm6
sleep 1
kill -KILL "$(main_pid takt-monitor)"
within 10 "monitor restarted" restarts_are takt-monitor 1
no_overrun_in 1000 "without and with another monitor"
mode_is tracking || fail "mode $(field mode)"
within 5 "second run folder" eval '[ "$(ls /var/lib/takt/runs | wc -l)" = 2 ]'
systemctl stop takt.target
