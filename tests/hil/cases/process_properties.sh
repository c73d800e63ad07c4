#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: what the units and the executive say of their processes is so: memory locked, schedulers and priorities, users, rights, whom the
#   out-of-memory killer takes first, and which frames the kernel wakes the executive for.
# Method: arm6 tracking; the kernel's own account of each process (/proc), and its lists of who receives which CAN frames before and after the
#   executive starts. `SystemCallFilter=~CALL:0` plants a call that does nothing and reports success.
# Mode: virtual
# Limit: 60 s
# Planted fault: mlockall does nothing and is reported as done.
# Planted by: /^plant$/i drop_in takt-executive.service Service SystemCallFilter= SystemCallFilter=~mlockall:0
# Planted fault: no process gets SCHED_FIFO, and all report that they did.
# Planted by: /^plant$/i drop_in takt-executive.service Service SystemCallFilter= SystemCallFilter=~sched_setscheduler:0
# Planted fault: the executive's service thread waits behind a busy policy.
# Planted by: /^plant$/i drop_in takt-executive.service Service CPUSchedulingPolicy=other
# Planted fault: the out-of-memory killer takes the executive like any other.
# Planted by: /^plant$/i drop_in takt-executive.service Service OOMScoreAdjust=0
# Planted fault: the policy host runs as the user who may arm.
# Planted by: /^plant$/i drop_in $POLICY.service Service User=takt
# Planted fault: the policy host may leave the sandbox by a program with more rights.
# Planted by: /^plant$/i drop_in $POLICY.service Service NoNewPrivileges=no SystemCallFilter= RestrictAddressFamilies= SystemCallArchitectures= RestrictNamespaces=no RestrictRealtime=no RestrictSUIDSGID=no LockPersonality=no MemoryDenyWriteExecute=no PrivateDevices=no ProtectKernelTunables=no ProtectKernelModules=no ProtectKernelLogs=no ProtectClock=no ProtectHostname=no
# Planted fault: the executive has every right that root has.
# Planted by: /^plant$/i drop_in takt-executive.service Service CapabilityBoundingSet=~ AmbientCapabilities=~
# Planted fault: the executive receives every frame of the bus: a receiver without a filter.
# Planted by: /^takt_up/i candump vcan0 >/dev/null &
. "$HIL_LIB/hil.sh"
can_up vcan0 vcan1
robot arm6
# receivers LIST: how many of them the kernel has for vcan0: all, or by identifier (fil, sff).
receivers() { awk '$1 == "vcan0"' "/proc/net/can/rcvlist_$1" | wc -l; }
plant
all=$(receivers all)
chosen=$(($(receivers sff) + $(receivers fil)))
takt_up
tracking
executive=$(main_pid takt-executive)
policy=$(main_pid $POLICY)
monitor=$(main_pid takt-monitor)

# of PID NAME: a line of its /proc/PID/status.
of() { sed -n "s/^$2:[[:space:]]*//p" "/proc/$1/status"; }
expect() { [ "$2" = "$3" ] || fail "$1: $2, not $3"; }
# scheduled PID THREAD: "POLICY PRIORITY", as ps calls them.
scheduled() { ps -L -o comm=,cls=,rtprio= -p "$1" | awk -v name="$2" '$1 == name { print $2, $3 }' | sort -u; }

locked=$(of "$executive" VmLck | cut -d' ' -f1)
resident=$(of "$executive" VmRSS | cut -d' ' -f1)
say "executive: $locked kB locked, $resident kB resident"
holds "$locked >= 0.95 * $resident" || fail "memory is not locked: $locked of $resident kB"
expect "the control thread's scheduling" "$(scheduled "$executive" takt-control)" "FF 80"
expect "the service thread's scheduling" "$(scheduled "$executive" takt-executive)" "FF 10"
expect "the policy host's scheduling" "$(ps -L -o cls= -p "$policy" | sort -u | tr -d ' ')" TS
expect "the executive's out-of-memory score" "$(cat "/proc/$executive/oom_score_adj")" -900
expect "the policy host's out-of-memory score" "$(cat "/proc/$policy/oom_score_adj")" 500
expect "the executive's user" "$(stat -c %U "/proc/$executive")" takt
expect "the policy host's user" "$(stat -c %U "/proc/$policy")" takt-policy
expect "the executive's rights" "$(of "$executive" CapBnd)" "$(printf %016x $((1 << 23 | 1 << 14 | 1 << 12)))" # CAP_SYS_NICE, CAP_IPC_LOCK, CAP_NET_ADMIN
expect "the policy host's rights" "$(of "$policy" CapBnd)" 0000000000000000
for pid in "$executive" "$policy" "$monitor"; do
  expect "no new rights for $(cat "/proc/$pid/comm")" "$(of "$pid" NoNewPrivs)" 1
  expect "system calls of $(cat "/proc/$pid/comm") are filtered" "$(of "$pid" Seccomp)" 2
done
[ "$(readlink "/proc/$policy/ns/net")" != "$(readlink /proc/self/ns/net)" ] || fail "the policy host is in the machine's network"
expect "receivers of every frame on vcan0, beside the drives" "$(receivers all)" "$all"
named=$(($(receivers sff) + $(receivers fil) - chosen))
[ "$named" -gt 0 ] || fail "the executive asks for no identifier on vcan0"
say "vcan0: the executive receives by $named filters, and nothing else"
