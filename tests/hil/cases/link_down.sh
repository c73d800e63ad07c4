#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: an interface that goes down latches a fault at once; when it is up again, the same processes recover.
# Method: `ip link set vcan0 down` while tracking, then up; reset, arm.
# Mode: virtual
# Limit: 90 s
# Planted fault: without `link set down`: no fault.
# Planted by: s/^ip link set vcan0 down/true/
. "$HIL_LIB/hil.sh"
tracking_arm6
ip link set vcan0 down
within 2 "fault" happened tracking fault_latched bus_down
grep bus_down /var/lib/takt/runs/*/transitions.jsonl
takt arm --runtime-dir $RUN && fail "armed with a bus that is down"
ip link set vcan0 up
within 3 "the bus is back" no_active_cause bus_down
recover
restarts_are takt-executive 0 || fail "the executive was restarted"
