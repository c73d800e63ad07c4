#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: the whole pipeline runs on SocketCAN with every drive protocol, classic and FD.
# Method: dual_arm12, twelve joints on four vcan interfaces: T-Motor and Damiao (mit), RobStride (29-bit ids), ODrive, moteus (FD) and CiA 402. Armed, tracking for
#   1000 periods without a late one; every interface carries frames of the kind its protocol uses.
# Mode: virtual
# Limit: 180 s
# Planted fault: vcan3 is missing: the executive does not start.
# Planted by: s/^can_up .*/can_up vcan0 vcan1 vcan2/
. "$HIL_LIB/hil.sh"
can_up vcan0 vcan1 vcan2 vcan3
robot dual_arm12
plant
takt_up
tracking
for bus in 0 1 2 3; do candump -L -T 500 -n 400 vcan$bus >frames.vcan$bus & done
wait
for bus in 0 1 2 3; do
  say "vcan$bus: $(wc -l <frames.vcan$bus) frames of $(cut -d' ' -f3 frames.vcan$bus | cut -d'#' -f1 | sort -u | wc -l) ids"
  [ "$(wc -l <frames.vcan$bus)" = 400 ] || fail "vcan$bus is quiet"
done
grep -q '##' frames.vcan3 || fail "no FD frame on vcan3"
grep -qE ' [0-9A-F]{8}#' frames.vcan* || fail "no 29-bit id"
no_overrun_in 1000 "twelve joints"
mode_is tracking || fail "mode $(field mode): $(cat /var/lib/takt/runs/*/transitions.jsonl)"
