#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: what a tick costs on CAN: system calls of the control thread, and the time from its wake-up to its frames on the bus, against a loop that
#   wakes up and writes the same number of frames and does nothing else (takt-bench-can).
# Method: arm6 tracking at 1 kHz, six frames on two buses; then the loop, alone. The kernel counts each thread's system calls (tracefs), a peer on the
#   bus stamps each frame (candump). can.py prints the table. Time is counted in instructions: the same on any host.
# Mode: virtual
# Limit: 60 s
# Planted fault: the loop is not there.
# Planted by: s/takt-bench-can vcan0/false vcan0/
. "$HIL_LIB/hil.sh"
TRACE=/sys/kernel/tracing
mountpoint -q $TRACE || mount -t tracefs tracefs $TRACE || fail "no tracefs"
CALLS=$TRACE/events/raw_syscalls/sys_enter
# count_calls THREAD: from now on, by number.
count_calls() { echo "hist:keys=id if common_pid==$1" >$CALLS/trigger || fail "no histogram of system calls"; }
stop_counting() { echo "!hist:keys=id if common_pid==$1" >$CALLS/trigger; }

tracking_arm6
control=$(grep -l takt-control /proc/"$(main_pid takt-executive)"/task/*/comm | cut -d/ -f5)
count_calls "$control"
candump -L vcan0 vcan1 >takt.log &
dump=$!
sleep 2
kill $dump
grep -E '^\{' $CALLS/hist >takt.calls
stop_counting "$control"
systemctl stop takt.target takt-executive takt-monitor $POLICY $PLANT # each by name: all have ended then

candump -L vcan0 vcan1 >plain.log &
dump=$!
"$HIL_LIB"/tools/takt-bench-can vcan0 vcan1 --frames 6 --periods 2000 >plain.woken &
plain=$!
count_calls $plain
wait $plain || fail "the plain loop"
kill $dump
grep -E '^\{' $CALLS/hist >plain.calls
stop_counting $plain
