#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: an IMU on a real CAN interface serves through its unit's sandbox, and the robot stops when it falls silent; it is heard again when it comes back, and when its interface does.
# Method: arm6 with an IMU on a third interface; an MTi's frames there while tracking; it ends, comes again, the interface goes down and comes up.
# Mode: virtual
# Limit: 120 s
# Planted fault: the IMU does not fall silent: no cause.
# Planted by: s/systemctl stop hil-mti/true/
. "$HIL_LIB/hil.sh"
can_up vcan0 vcan1 vcan2
robot arm6 's/^joints:/  - { name: aux, interface: can2, bitrate: 1 Mbit\/s, fd: false, when_missing: refuse }\n&/' \
  's/^sensors:/&\n  - { name: torso, values: 10, timeout: 20 ms }/' '$a imu: { sensor: torso, tilt: 0.5 rad, frozen_after: 300 ms }'
sed -i 's/interface: can2/interface: vcan2/' $ROBOT
mti() { systemd-run --quiet --collect --unit hil-mti python3 "$HIL_LIB/mti.py" vcan2 || fail "no MTi"; }
plant
mti
drop_in takt-imu-can@aux.service Service 'ExecStart=' \
  'ExecStart=/usr/bin/takt-imu --robot /etc/takt/robot/robot.yaml --runtime-dir /run/takt --bus aux --can-ids 0x106,0x121,0x132,0x134'
systemctl start takt-imu-can@aux || fail "takt-imu-can@aux"
takt_up
tracking
within 5 "heard" eval 'journalctl -u takt-imu-can@aux | grep -q "an MTi is heard at vcan2"'
systemctl stop hil-mti
within 3 "imu_lost" active_cause imu_lost
within 3 "stop" mode_is damped_stop
say "$(tail -qn 1 /var/lib/takt/runs/*/transitions.jsonl)"
mti
within 10 "no imu_lost" no_active_cause imu_lost
recover
ip link set vcan2 down
within 3 "imu_lost again" active_cause imu_lost
within 3 "stop again" mode_is damped_stop
ip link set vcan2 up
systemctl stop hil-mti 2>/dev/null
mti
within 10 "no imu_lost" no_active_cause imu_lost
recover
