#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: `takt run` drives the robot over SocketCAN without systemd: what `./dev hil --native` runs on a machine that has vcan.
# Method: that very script, in the guest.
# Mode: virtual
# Limit: 120 s
# Runs: none
# Planted fault: one interface left down: takt run refuses.
# Planted by: s/^"$HIL_LIB.native.sh"/sed 's|ip link set "$interface" up|true|' "$HIL_LIB\/native.sh" >native.sh; bash native.sh/
"$HIL_LIB/native.sh" /usr/bin "$HIL_LIB/robots"
