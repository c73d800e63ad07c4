#!/bin/bash
# Goal: systemd's watchdog ends an executive that hangs, and starts another, disarmed.
# Method: SIGSTOP while tracking: no thread runs, as after a deadlock in the kernel. WatchdogSec=500ms passes; the abort signal finds nobody, so that
#   SIGKILL follows after TimeoutAbortSec. The journal names the watchdog as the reason.
# Mode: virtual
# Limit: 120 s
# Planted fault: `WatchdogSec=0` in the unit: nothing happens.
# Planted by: /^tracking_arm6/i drop_in takt-executive.service Service WatchdogSec=0
. "$HIL_LIB/hil.sh"
tracking_arm6
hung=$(main_pid takt-executive)
kill -STOP "$hung"
within 3 "watchdog" eval 'journalctl -u takt-executive -o cat | grep -q "Watchdog timeout"'
within 10 "another executive" restarts_are takt-executive 1
[ "$(main_pid takt-executive)" != "$hung" ] || fail "the hung process is still the service"
within 5 "standby" mode_is standby
[ "$(field drives_enabled)" = false ] || fail "the executive came back with drives enabled"
lift
tracking
