#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: whatever hangs beside the executive, a stop without power is on the bus within two periods of being asked for.
# Method: arm6; the executive's log goes into a pipe that is full; monitor (and with it disk and DDS) and policy host get SIGSTOP. One datagram into the
#   stop line, stamped before it is sent; each drive's first disable frame has the kernel's stamp (candump). Three times.
# Mode: virtual
# Limit: 120 s
# Planted fault: a soft stop (verb 2) instead: drives damp, and none is disabled.
# Planted by: /^tracking_arm6/i sed -i "s/DEENERGISE = 6/DEENERGISE = 2/" "$HIL_LIB/stop_line.py"
. "$HIL_LIB/hil.sh"
mkfifo -m 666 /run/hil-log
sleep infinity <>/run/hil-log &
drop_in takt-executive.service Service StandardOutput=file:/run/hil-log StandardError=inherit
tracking_arm6
# By a writer that does not wait; from here on one that does waits for ever.
dd if=/dev/zero of=/run/hil-log bs=1 oflag=nonblock status=none 2>/dev/null

for round in 1 2 3; do
  candump -L vcan0 vcan1 >frames.log &
  dump=$!
  within 2 "frames" test -s frames.log
  kill -STOP "$(main_pid takt-monitor)" "$(main_pid $POLICY)"
  asked=$("$HIL_LIB/stop_line.py" $RUN/stop.sock) || fail "the stop line takes nothing"
  sleep 0.2
  kill $dump
  # Each drive's first disable frame after the request, us.
  grep -E ' 00[1-6]#FFFFFFFFFFFFFFFD' frames.log | tr -d '()' | awk -v asked="$asked" '
    { after = ($1 - asked) * 1e6; split($3, id, "#") } after > 0 && !(id[1] in first) { first[id[1]] = after; print after }' | sort -n >told.txt
  [ "$(wc -l <told.txt)" = 6 ] || fail "round $round: $(wc -l <told.txt) of 6 drives were disabled: $(tail -6 frames.log)"
  say "round $round: from the request to the first and the last drive's frame: $(head -1 told.txt) and $(tail -1 told.txt) us"
  holds "$(tail -1 told.txt) < 2000" || fail "later than two periods"
  pushes=$(grep -E ' 00[1-6]#' frames.log | tail -6 | grep -vc 'FFFFFFFFFFFFFFFD')
  [ "$pushes" = 0 ] || fail "a drive got something else at the end"
  kill -CONT "$(main_pid takt-monitor)" "$(main_pid $POLICY)"
  mode_is standby || within 10 "reset" was_reset
  lift
  tracking
done
