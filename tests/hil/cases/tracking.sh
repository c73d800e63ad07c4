#!/bin/bash
# Goal: the units start the robot on real CAN interfaces, and the installed executive misses no period of 10,000.
# Method: arm6 on two vcan interfaces, started by takt.target, armed; 10 s of tracking, and then 5 s more with four
#   processes that never sleep at ordinary priority. Overruns are the executive's own count.
# Mode: virtual
# Limit: 90 s
. "$HIL_LIB/hil.sh"
can_up vcan0 vcan1
robot arm6
plant
takt_up
tracking
say "tracking; $(systemctl show -P StatusText takt-executive)"
takt status --runtime-dir $RUN --json
