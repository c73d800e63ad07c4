#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: Takt drives real CAN controllers: SJA1000 with bit timing, interrupts in threads, short queues.
# Method: four emulated PCI cards on two emulated buses; the executive has can0 and can2, the plant can1 and can3. `takt bus up` sets the
#   bit rates of the robot file. The plant refuses real interfaces unless told; `takt bus scan` refuses an executive's buses wherever it is told to look.
#   First one card has another bit rate: the executive does not start.
# Mode: virtual
# Machine: kvaser
# Limit: 120 s
# Planted fault: can3 is down: the wrist's drives are not heard.
# Planted by: s/^plant --on/ip link set can3 down; plant --on/
. "$HIL_LIB/hil.sh"
modprobe kvaser_pci || fail "no kvaser_pci"
within 5 "four cards" test -e /sys/class/net/can3
robot arm6 's/interface: vcan1/interface: can2/' 's/interface: vcan0/interface: can0/'
# A controller with another bit rate than the robot file's: every frame would be an error on the bus.
takt bus up --robot $ROBOT && ip link set can2 down && ip link set can2 type can bitrate 500000 && ip link set can2 up || fail "no other bit rate"
takt-executive --robot $ROBOT --runtime-dir $RUN >refused.txt 2>&1 && fail "an executive on a bus of another bit rate"
grep -q 'can2: 500000 bit/s, the robot file says 1000000 bit/s' refused.txt || fail "refused for another reason: $(cat refused.txt)"
PLANT_ROBOT=/etc/takt/robot/plant.yaml
sed -e 's/interface: can2/interface: can3/' -e 's/interface: can0/interface: can1/' $ROBOT >$PLANT_ROBOT
for file in $ROBOT $PLANT_ROBOT; do takt bus up --robot "$file" || fail "takt bus up --robot $file"; done
ip -d link show can0 | grep -E 'bitrate|state'
ip -d link show can0 | grep -q 'bitrate 1000000' || fail "not the robot file's bit rate"
takt-plant --robot $PLANT_ROBOT --runtime-dir $RUN 2>plant.txt && fail "the plant speaks on a real interface unasked"
grep -q 'can1 is a real CAN interface' plant.txt || fail "the plant refuses for another reason: $(cat plant.txt)"
plant --on-hardware
takt_up
tracking
grep -A3 '"controller"' $RUN/executive.json | grep -q '"bitrate": 1000000' || fail "the run does not say how its controllers were set: $(cat $RUN/executive.json)"
no_overrun_in 1000 "on SJA1000 controllers"
takt bus scan --robot $ROBOT --runtime-dir /run/elsewhere >scan.txt 2>&1 && fail "a second master on the bus: $(cat scan.txt)"
grep -q "an executive runs in $RUN" scan.txt || fail "no scan, for another reason: $(cat scan.txt)"
mode_is tracking || fail "mode $(field mode): $(cat /var/lib/takt/runs/*/transitions.jsonl)"
ip link set can2 down
within 2 "fault" happened tracking fault_latched bus_down
