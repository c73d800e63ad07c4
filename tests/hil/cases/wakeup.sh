#!/bin/bash
# Goal: in virtual time a real-time thread wakes up on time, and `takt doctor` measures what cyclictest measures.
# Method: cyclictest and `takt doctor` for five seconds each at 1 kHz, SCHED_FIFO, in a guest without a robot. Both must stay below 100 us:
#   where this fails, no other figure of virtual time means anything.
# Mode: virtual
# Limit: 90 s
# Planted fault: the same in paced mode on a busy host: milliseconds.
. "$HIL_LIB/hil.sh"
cyclictest -q -m -p 80 -i 1000 -l 5000 -h 100 >cyclictest.txt || fail "cyclictest"
worst=$(sed -n 's/^# Max Latencies: 0*//p' cyclictest.txt)
say "cyclictest, us: $(grep -hE '^# (Min|Avg|Max) Lat' cyclictest.txt | sed 's/^# //; s/ Latencies//' | tr '\n' ' ')"
takt doctor --seconds 5 --json >doctor.json 2>doctor.txt
grep -o '"wakeup[^}]*}' doctor.json || cat doctor.json
takt doctor --seconds 0 | grep -vE '^ *$' | head -30
holds "${worst:-1000} < 100" || fail "cyclictest: $worst us"
