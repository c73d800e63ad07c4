#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: a machine whose executive and systemd both hang is reset by its hardware watchdog.
# Method: systemd feeds an emulated i6300esb (RuntimeWatchdogSec=). Three of its periods pass without a reset. The executive gets SIGSTOP, systemd SIGSEGV, upon
#   which it freezes. The machine must start again: the case's second run sees what the first one left.
# Mode: virtual
# Machine: watchdog
# Limit: 120 s
# Planted fault: without SIGSEGV to systemd the machine is not reset.
# Planted by: s/^kill -SEGV 1/true/
. "$HIL_LIB/hil.sh"
if [ "$HIL_BOOT" = 2 ]; then
  [ -e /hil/out/frozen ] || fail "the machine was reset before anything hung"
  say "the watchdog has reset the machine"
  exit 0
fi
modprobe i6300esb || fail "no watchdog device"
mkdir -p /run/systemd/system.conf.d
printf '[Manager]\nRuntimeWatchdogSec=2s\n' >/run/systemd/system.conf.d/watchdog.conf
systemctl daemon-reexec
sleep 7
can_up vcan0 vcan1
robot arm6
plant
takt_up
cat /sys/class/watchdog/watchdog0/identity 2>/dev/null || ls /sys/class/watchdog
kill -STOP "$(main_pid takt-executive)"
touch /hil/out/frozen
kill -SEGV 1
sleep 60
fail "no reset within 60 s"
