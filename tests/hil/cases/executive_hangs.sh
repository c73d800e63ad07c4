#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: drives without a command stop by their own watchdogs; systemd's ends the executive that hangs, and starts another, disarmed.
# Method: SIGSTOP while tracking: no thread runs, as after a deadlock in the kernel. After the drives' 50 ms, which the executive wrote into them, and before systemd's 500, each is asked
#   for its state (Damiao's refresh, which commands nothing): D, communication lost. Then WatchdogSec passes; the abort signal finds no handler, so that
#   SIGKILL follows after TimeoutAbortSec. The journal names the watchdog as the reason.
# Mode: virtual
# Limit: 120 s
# Planted fault: `WatchdogSec=0` in the unit: nothing happens.
# Planted by: /^tracking_arm6/i drop_in takt-executive.service Service WatchdogSec=0
. "$HIL_LIB/hil.sh"
tracking_arm6
hung=$(main_pid takt-executive)
kill -STOP "$hung"
sleep 0.07
candump -L vcan0 vcan1 >drives.log &
candump=$!
sleep 0.03
for joint in 1 2 3; do
  cansend vcan0 "7FF#0${joint}00CC0000000000"
  cansend vcan1 "7FF#0$((joint + 3))00CC0000000000"
done
sleep 0.01
kill $candump
journalctl -u takt-executive -o cat | grep "Watchdog timeout" && fail "systemd came first: the drives were asked too late"
for joint in 1 2 3 4 5 6; do
  grep -q " 01$joint#D$joint" drives.log || fail "drive $joint has not stopped by itself: $(cat drives.log)"
done
say "every drive has stopped by its own watchdog"
within 3 "watchdog" eval 'journalctl -u takt-executive -o cat | grep -q "Watchdog timeout"'
within 10 "another executive" restarts_are takt-executive 1
[ "$(main_pid takt-executive)" != "$hung" ] || fail "the hung process is still the service"
within 5 "standby" mode_is standby
[ "$(field drives_enabled)" = false ] || fail "the executive came back with drives enabled"
lift
tracking
