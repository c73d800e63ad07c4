#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: a controller that goes bus-off latches a fault; the one command that status names has it run again within 2 s, by the same processes.
# Method: the wrist's bus runs over slcan: a real CAN controller state machine of the kernel, whose adapter is a script that passes frames to and from the
#   plant. While tracking the adapter reports bus-off; the command; reset, arm. slcan cannot restart a controller by
#   itself (no do_set_mode), as gs_usb since Linux 6.12.47.
# Mode: virtual
# Limit: 120 s
# Planted fault: the adapter is not told to report it (no SIGUSR1): no fault.
# Planted by: s/^kill -USR1 .*/true/
. "$HIL_LIB/hil.sh"
modprobe slcan || fail "no slcan"
can_up vcan0 vcan1
robot arm6
PLANT_ROBOT=/etc/takt/robot/plant.yaml
cp $ROBOT $PLANT_ROBOT
chrt -f 30 "$HIL_LIB/slcan_bridge.py" vcan1 >bridge.txt 2>&1 &
bridge=$!
within 5 "adapter" test -s bridge.txt
adapter=$(cat bridge.txt)
sed -i "s/interface: vcan1/interface: $adapter/" $ROBOT
takt bus up --robot $ROBOT --interface $adapter || fail "no $adapter"
plant
takt_up
tracking

kill -USR1 $bridge
within 2 "fault" happened tracking fault_latched bus_off
ip -d -s link show $adapter | grep -oE 'can .*state [A-Z-]+' | head -1
ip -d link show $adapter | grep -q BUS-OFF || fail "the kernel does not think so"
takt arm --runtime-dir $RUN && fail "armed with a bus that is off"
restart=$(takt status --runtime-dir $RUN | grep -oE "takt bus up --robot [^ ]+ --interface $adapter" | head -1)
[ -n "$restart" ] || fail "status names no command"
$restart || fail "refused: $restart"
runs_again() { no_active_cause bus_off && no_active_cause feedback_lost; }
within 2 "bus-off is over, and replies come" runs_again
recover
restarts_are takt-executive 0 || fail "the executive was restarted"
