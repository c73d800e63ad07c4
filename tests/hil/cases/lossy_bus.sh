#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: replies that are lost, late or doubled on a real interface are told apart and stop the robot softly.
# Method: netem on vcan0, which hands frames back itself (echo=1), while tracking: 100 % duplication, then frames in bunches, one every 12 ms, then 70 % loss;
#   each time the cause that docs/bus-faults.md names, then none, reset, arm. feedback.timeout is 60 ms, or the first bunch would come after a silence.
#   netem's second copies of our own frames come back as a stranger's, so that the first transition may name foreign_node.
# Mode: virtual
# Limit: 120 s
# Planted fault: netem on lo instead: no cause.
# Planted by: s/tc qdisc replace dev vcan0/tc qdisc replace dev lo/
. "$HIL_LIB/hil.sh"
can_up vcan0 vcan1
robot arm6 's/^  timeout: 20 ms/  timeout: 60 ms/'
plant
takt_up
tracking
trouble() {
  local cause=$1
  shift
  tc qdisc replace dev vcan0 root netem limit 10000 "$@" || fail "tc netem $*"
  within 10 "$cause" active_cause "$cause"
  within 5 "stop" eval 'mode_is damped_stop || mode_is fault_latched'
  say "netem $*: $(tail -qn 1 /var/lib/takt/runs/*/transitions.jsonl)"
  tc qdisc del dev vcan0 root
  within 10 "no $cause" no_active_cause "$cause"
  recover
}
trouble replies_repeated duplicate 100%
trouble replies_delayed slot 12ms 12ms
trouble replies_lost loss 70%
