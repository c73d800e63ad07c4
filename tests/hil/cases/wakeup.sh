#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: in virtual time a real-time thread wakes up on time, and `takt doctor` measures what cyclictest and the kernel's own tracers measure.
# Method: cyclictest, rtla timerlat and `takt doctor` for five seconds each at 1 kHz, SCHED_FIFO, in a guest without a robot. All must stay below
#   100 us: where this fails, no other figure of virtual time means anything. Two histograms are printed side by side. rtla osnoise says what else
#   took the processor.
# Mode: virtual
# Limit: 60 s
# Runs: none
# Planted fault: two seconds in, a process of a higher priority (chrt -f 90) works for some tens of milliseconds.
# Planted by: /^cyclictest/i (sleep 2; chrt -f 90 dd if=/dev/zero of=/dev/null bs=64M count=4) &
. "$HIL_LIB/hil.sh"
cyclictest -q -m -p 80 -i 1000 -l 5000 -h 100 >cyclictest.txt || fail "cyclictest"
takt doctor --for 5 --json >doctor.json 2>doctor.txt
grep -o '"wakeup[^}]*}' doctor.json || fail "takt doctor: $(cat doctor.txt doctor.json)"
say "cyclictest, us: $(grep -hE '^# (Min|Avg|Max) Lat' cyclictest.txt | sed 's/^# //; s/ Latencies//' | tr '\n' ' ')"
rtla timerlat hist -c 0 -p 1000 -P f:80 -d 5s -E 100 >timerlat.txt 2>&1 || fail "rtla timerlat: $(cat timerlat.txt)"
say "rtla timerlat, us: $(grep -E '^(min|avg|max):' timerlat.txt | tr -s ' ' | tr '\n' ' ')"
rtla osnoise top -q -c 0 -p 1000000 -r 100000 -d 3s >osnoise.txt 2>&1 || fail "rtla osnoise: $(cat osnoise.txt)"
say "rtla osnoise: $(tail -1 osnoise.txt)"

# cyclictest's counts of each microsecond, in the doctor's buckets: up to 2, 4, 8, ... us.
grep -E '^[0-9]{6} ' cyclictest.txt | awk '{ k = $1 < 2 ? 0 : int(log($1) / log(2) + 1e-9); n[k] += $2 } END { for (k = 0; k < 7; k++) print n[k] + 0 }' >cyclictest.counts
sed 's/.*"histogram_log2_us":\[\([^]]*\)\].*/\1/' doctor.json | tr , '\n' >doctor.counts
paste -d' ' cyclictest.counts doctor.counts | awk '{ printf "below %3d us: cyclictest %5d, takt doctor %5d\n", 2 ^ NR, $1, $2 }'

worst=$(sed -n 's/^# Max Latencies: 0*//p' cyclictest.txt)
holds "${worst:-1000} < 100" || fail "cyclictest: $worst us"
worst=$(sed 's/.*"max_ns":\([0-9]*\).*/\1/' doctor.json)
holds "$worst < 100000" || fail "takt doctor: $worst ns"
worst=$(sed -n 's/^max: *//p' timerlat.txt | tr -s ' ' '\n' | sort -n | tail -1)
holds "${worst:-1000} < 100" || fail "rtla timerlat: $worst us"
