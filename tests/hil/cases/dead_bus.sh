#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: what waits in the queue of a bus that stands still does not leave once it is too old: a dead bus that comes back moves nothing.
# Method: arm6 tracking; vcan0, which hands frames back when they left (echo=1), keeps what it is given for 3 s (netem): no drive answers, nothing
#   arrives. A peer on the bus stamps every frame that comes out; dead_bus.py finds for each the tick that wrote it, and so its command's oldest sample.
# Mode: virtual
# Limit: 90 s
# Planted fault: the executive may not empty the queue.
# Planted by: /^tracking_arm6/i drop_in takt-executive.service Service 'CapabilityBoundingSet=' 'CapabilityBoundingSet=CAP_SYS_NICE CAP_IPC_LOCK' 'AmbientCapabilities=' 'AmbientCapabilities=CAP_SYS_NICE CAP_IPC_LOCK'
. "$HIL_LIB/hil.sh"
tracking_arm6
candump -D -L vcan0 >frames.log &
dump=$!
sleep 3
tc qdisc replace dev vcan0 root netem limit 10000 delay 3s || fail "tc netem"
within 2 "fault" eval 'mode_is damped_stop || mode_is fault_latched'
sleep 5 # whatever was not thrown away has left
tc qdisc del dev vcan0 root
within 5 "the bus is back" no_active_cause bus_down
recover
sleep 2
kill $dump
restarts_are takt-executive 0 || fail "the executive was restarted"
journalctl -u takt-executive -o cat | grep -i 'queue\|too old\|older than' | head -3
say "$(cat /var/lib/takt/runs/*/transitions.jsonl | wc -l) transitions, $(wc -l <frames.log) frames"
