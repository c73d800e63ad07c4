#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: the units start the robot on SocketCAN interfaces; the executive misses none of 10,000 periods, alone and among busy neighbours.
# Method: arm6 on two vcan interfaces, started by takt.target, armed. Ten thousand periods of tracking, then
#   ten thousand beside four processes that never sleep. Late and skipped periods are the executive's own count; when a
#   command frame was sent is the kernel's stamp (candump).
# Mode: virtual
# Limit: 120 s
# Planted fault: the hogs' priority is higher (chrt -f 90): overruns.
# Planted by: s,do md5sum /dev/zero,do chrt -f 90 dd if=/dev/zero of=/dev/null bs=64M count=4,
. "$HIL_LIB/hil.sh"
tracking_arm6
[ "$(field realtime)" = true ] || fail "not real time: $(journalctl -u takt-executive -o cat | grep FAILED)"

candump -L -n 4000 vcan0 >frames.log &
wait $!
# Command frames of joint 1 (id 001): the time between them, in us, against the period of 1000 us.
grep ' 001#' frames.log | sed 's/^(\([0-9.]*\)).*/\1/' | awk 'NR > 1 { print ($1 - last) * 1e6 } { last = $1 }' | sort -n >periods.txt
[ "$(wc -l <periods.txt)" -gt 500 ] || fail "$(wc -l <periods.txt) command frames of joint 1 among 4000 frames"
say "period of joint 1's frames, us: $(awk '{ v[NR] = $1 } END { printf "min %.0f p50 %.0f p99 %.0f max %.0f of %d", v[1], v[int(NR * .5)], v[int(NR * .99)], v[NR], NR }' periods.txt)"
holds "$(head -1 periods.txt) > 800 && $(tail -1 periods.txt) < 1200" || fail "a frame is more than 200 us from its period"

# Processor time of every thread so far, ns.
threads() {
  for unit in takt-executive takt-monitor $POLICY $PLANT; do
    for task in /proc/"$(main_pid "$unit")"/task/*; do echo "$(cat "$task/comm") $(cut -d' ' -f1 "$task/schedstat")"; done
  done
}
before=$(threads) began=$(now)
no_overrun_in 10000 "tracking alone"
say "processor: $(paste -d' ' <(echo "$before") <(threads) | awk -v s="$(awk "BEGIN { print $(now) - $began }")" '
  { used[$1] += $4 - $2 } END { for (name in used) if (used[name] > 1e6) printf "%s %.1f %% ", name, used[name] / s / 1e7 }')"
mode_is tracking || fail "mode $(field mode)"
for _ in 1 2 3 4; do md5sum /dev/zero & done
no_overrun_in 10000 "among four hogs"
kill $(jobs -p)
mode_is tracking || mode_is degraded || fail "mode $(field mode)"
