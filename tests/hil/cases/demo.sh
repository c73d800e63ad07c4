#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: what is installed runs the packaged demo robot by `systemctl start takt.target` alone, on no CAN interface, and says what it is and on what it runs.
# Method: no file of the rig's: start, arm, 1000 periods of tracking. An interface can0, as an adapter would be, hears nothing. The executive holds /dev/cpu_dma_latency open and
#   states the hash of its own binary, which is the installed file's and stands in the run's manifest too; `takt doctor` judges the machine by
#   the demo's robot file.
# Mode: virtual
# Limit: 90 s
# Planted fault: `chmod 600 /dev/cpu_dma_latency` first: the executive cannot open it.
# Planted by: /^takt_up/i chmod 600 /dev/cpu_dma_latency
. "$HIL_LIB/hil.sh"
can_up can0 can1
candump -L can0 can1 >frames.log &
takt_up
tracking
no_overrun_in 1000 "the demo robot"
mode_is tracking || fail "mode $(field mode)"
[ ! -s frames.log ] || fail "the simulated robot speaks on a CAN interface: $(head -3 frames.log)"

pid=$(main_pid takt-executive)
find "/proc/$pid/fd" -lname /dev/cpu_dma_latency | grep -q . || fail "the executive does not hold /dev/cpu_dma_latency: $(grep -A3 cpu_dma $RUN/executive.json)"
hash=$(sha256sum /usr/bin/takt-executive | cut -d' ' -f1)
grep -q "\"binary_sha256\": \"$hash\"" $RUN/executive.json || fail "executive.json does not state the binary's hash: $(grep sha256 $RUN/executive.json)"
grep -q "$hash" /var/lib/takt/runs/*/manifest.json || fail "the manifest does not state it"

takt doctor --for 1 --robot $ROBOT --json >doctor.json 2>doctor.txt
[ $? -le 1 ] || fail "takt doctor: $(cat doctor.txt)"
say "takt doctor: $(grep -oE '"verdict":"[a-z]+"' doctor.json | head -1)"
grep -q '"schema":"takt.doctor/1"' doctor.json || fail "no verdict: $(head -c 300 doctor.json)"
