#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: an adapter that is pulled out stops the robot; plugged in again it comes up by itself, with the robot file's bit rate.
# Method: takt-can@ of two emulated PCI cards, enabled, and udev, which starts and stops these units with their devices. While tracking one card is
#   taken off its bus (sysfs), then found again. The executive's sockets died with the card: as the page says, takt.target is restarted.
# Mode: virtual
# Machine: kvaser
# Limit: 120 s
# Planted fault: takt-can@ is not enabled: nothing brings the adapter up again.
# Planted by: s/^systemctl enable/systemctl start/
. "$HIL_LIB/hil.sh"
modprobe kvaser_pci || fail "no kvaser_pci"
within 5 "four cards" test -e /sys/class/net/can3
robot arm6 's/interface: vcan1/interface: can2/' 's/interface: vcan0/interface: can0/'
PLANT_ROBOT=/etc/takt/robot/plant.yaml
sed -e 's/interface: can2/interface: can3/' -e 's/interface: can0/interface: can1/' $ROBOT >$PLANT_ROBOT
takt bus up --robot $PLANT_ROBOT || fail "takt bus up of the plant"
is_up() { is_active takt-can@"$1" && ip -d link show "$1" | grep -q 'bitrate 1000000'; }
has_ended() { [ "$(systemctl show -P ActiveState takt-can@"$1")" = inactive ]; }
systemctl enable takt-can@can0 takt-can@can2
plant --on-hardware
takt_up
for name in can0 can2; do within 5 "takt-can@$name" is_up $name; done
tracking

card=$(readlink -f /sys/class/net/can2/device)
echo 1 >"$card/remove"
within 2 "fault" happened tracking fault_latched bus_down
within 5 "takt-can@can2 ends with its device" has_ended can2
is_up can0 || fail "can0 went with it"
echo 1 >/sys/bus/pci/rescan
within 10 "takt-can@can2 comes with its device" is_up can2
say "can2 came back: $(ip -d link show can2 | grep -oE 'state [A-Z-]+|bitrate [0-9]+' | tr '\n' ' ')"
systemctl restart takt.target
lift
within 10 "an executive again" takt status --runtime-dir $RUN
tracking
