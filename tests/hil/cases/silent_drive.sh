#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: a drive of any protocol that obeys and is no longer heard gets no more force from us; `takt stop --now` takes everybody's power then too.
# Method: dual_arm12 tracking; the simulated drive of one joint of each protocol falls silent for 1.5 s, 1 s after it was enabled. What the bus
#   carries to that drive from 100 ms after the fault on is read from candump, by patterns that come from the protocols' own pages: no frame that
#   pushes, and frames to others go on. Then the other drives are asked to let go, while it is silent still.
# Mode: virtual
# Limit: 180 s
# Planted fault: answers that come 1 ms later instead of none: no fault.
# Planted by: s/fault: silent/delay: 1 ms/
. "$HIL_LIB/hil.sh"
can_up vcan0 vcan1 vcan2 vcan3
robot dual_arm12
SCENARIO=/etc/takt/robot/scenario.yaml
# falls_silent JOINT: in the simulation that starts next.
falls_silent() {
  printf 'schema: takt.scenario/1\nevents:\n  - { after: enabled, at: 1000 ms, joint: %s, fault: silent, for: 1500 ms }\n' "$1" >$SCENARIO
}
named() { grep -q "\"to\":\"fault_latched\",\"cause\":\"feedback_lost\",\"detail\":\"joint $1" /var/lib/takt/runs/*/transitions.jsonl; }

# silent JOINT BUS PUSHES OTHERS: two patterns of frames, of what makes this drive push, and of what goes to the others of the bus.
silent() {
  local joint=$1 bus=$2 pushes=$3 others=$4 before
  candump -L $bus >before.txt &  # from before the drives are enabled: a client that looks for `tracking` may see it only after the fault
  before=$!
  tracking
  within 5 "$joint: fault" named "$joint"
  kill $before
  grep -qE "$pushes" before.txt || fail "$joint: the pattern finds nothing while it is healthy: $(tail -4 before.txt)"
  sleep 0.1
  candump -L -T 1000 -n 600 $bus >after.txt
  grep -E "$pushes" after.txt | head -3 | grep . && fail "$joint: pushed while it is not heard"
  grep -qE "$others" after.txt || fail "$joint: nothing goes to the others of $bus"
  takt stop --now --runtime-dir $RUN || fail "$joint: takt stop --now"
  candump -L -T 1000 -n 100 $bus >let_go.txt
  grep -E "$pushes|$others" let_go.txt | grep . && fail "$joint: a drive pushes after takt stop --now"
  say "$joint: silent, $(wc -l <after.txt) frames on $bus read, none pushes it"
}

falls_silent left_elbow
plant --scenario $SCENARIO
takt_up
silent left_elbow vcan0 ' 003#[0-9A-E]' ' 00[12]#[0-9A-E]'            # MIT: anything but FF..FD
again() {
  within 5 "heard again" no_active_cause feedback_lost
  within 10 "reset" was_reset
  falls_silent "$1"
  lift
}
again left_wrist_roll
silent left_wrist_roll vcan1 ' 01....04#' ' 0CE#[0-9A-F]*[1-9A-F]'                     # RobStride: type 1, control
again left_wrist_pitch
silent left_wrist_pitch vcan1 ' 0A[CDE]#[0-9A-F]*[1-9A-F]' ' 01....04#'                # ODrive: input position, velocity, torque other than 0
again right_base_yaw
silent right_base_yaw vcan2 ' 201#.[89A-F]' ' 202#.[89A-F]'           # CiA 402: controlword bit 3, enable operation
again right_wrist_roll
silent right_wrist_roll vcan3 ' 00008001##.01000A' ' 0000800[23]##.01000A'  # moteus: register 0, mode 10
