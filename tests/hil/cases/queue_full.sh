#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: a bus that cannot carry our frames (ENOBUFS) stops the robot softly, and is forgiven once it can.
# Method: a token bucket (tc tbf) of 200 kbit/s with a short queue in front of vcan0 while tracking; then none; reset, arm.
# Mode: virtual
# Limit: 90 s
# Planted fault: the bucket of 200 Mbit/s: nothing happens.
# Planted by: s/rate 200kbit burst 500 limit 1000/rate 200mbit burst 5000000 limit 10000000/
. "$HIL_LIB/hil.sh"
tracking_arm6
tc qdisc replace dev vcan0 root tbf rate 200kbit burst 500 limit 1000 || fail "tc tbf"
within 5 "transmit_queue_full" active_cause transmit_queue_full
within 5 "damped stop or fault" eval 'mode_is damped_stop || mode_is fault_latched'
cat /var/lib/takt/runs/*/transitions.jsonl | tail -2
tc qdisc del dev vcan0 root
within 10 "the queue is empty" no_active_cause transmit_queue_full
recover
