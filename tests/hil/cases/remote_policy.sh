#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: over a bad network a robot whose policy runs on another machine is as safe as over a good one: its commands are older by what the wire
#   takes, none is played older than max_age, a short cut degrades it until the network is back, a long one stops it for good.
# Method: takt-policy-bridge by its unit, server and policy host in another network namespace, a veth pair between them with netem on both ends: delay
#   and jitter, loss, frames twice and out of order, loss of all for 0.4 s, then the link down for 1 s. A peer on the buses stamps two joints' frames;
#   remote_policy.py judges ticks and frames, act by act.
# Mode: virtual
# Limit: 120 s
# Planted fault: the way back is not delayed: commands are younger than the wire allows.
# Planted by: s/^  tc -n far qdisc replace/  true/
# Planted fault: the robot plays commands of up to 400 ms.
# Planted by: s/^robot arm6 /&'s|max_age: 150 ms|max_age: 400 ms|' /
. "$HIL_LIB/hil.sh"
POLICY=takt-policy-bridge
FAR=/run/far
# wire NETEM...: what the wire does to packets, each way. healed: nothing.
wire() {
  tc qdisc replace dev wire0 root netem limit 10000 "$@" || fail "tc netem $*"
  tc -n far qdisc replace dev wire1 root netem limit 10000 "$@" || fail "tc netem $*"
}
healed() {
  tc qdisc del dev wire0 root
  tc -n far qdisc del dev wire1 root
}
# act NAME: what is judged from now on; what the wire does then, the next line says.
act() { echo "$1 $(now)" >>acts.txt; }

ip netns add far && ip link add wire0 type veth peer name wire1 netns far || fail "no veth pair"
ip address add 10.77.0.1/24 dev wire0 && ip link set wire0 up || fail "wire0"
ip -n far address add 10.77.0.2/24 dev wire1 && ip -n far link set wire1 up || fail "wire1"
can_up vcan0 vcan1
robot arm6 '$a\dds: { interface: wire0, peers: [{ address: 10.77.0.1 }, { address: 10.77.0.2 }] }'
plant

systemctl mask --quiet --now takt-policy-host@robot
systemctl enable --quiet takt-policy-bridge
drop_in takt-policy-bridge.service Service IPAddressAllow=10.77.0.0/24
install -d -o takt-policy -g takt $FAR
there() { systemd-run --quiet --unit "hil-$1" --uid takt-policy --gid takt "${@:2}" --robot $ROBOT --runtime-dir $FAR || fail "$1 does not start"; }
there server -p NetworkNamespacePath=/run/netns/far takt-policy-server --name far --interface wire1
there host takt-policy-host
takt_up
tracking
candump -L vcan0,001:7FF vcan1,004:7FF >frames.log &
dump=$!

sleep 0.5
act good
sleep 1.5
act delayed
wire delay 10ms 5ms
sleep 3
act lossy
wire loss 10%
sleep 2
act disordered
wire delay 10ms reorder 25% duplicate 25%
sleep 2
act healed
healed
within 3 "tracking with the network as it was" mode_is tracking
sleep 0.5

act cut
wire loss 100%
sleep 0.4
healed
within 3 "tracking again, by itself" mode_is tracking
sleep 0.5
act down
ip link set wire0 down
sleep 1
mode_is damped_stop || fail "mode $(field mode) with the link down"
ip link set wire0 up
sleep 1
mode_is damped_stop || fail "what stopped waits for a person: mode $(field mode)"
act after
recover
sleep 0.5
kill $dump
restarts_are takt-executive 0 && restarts_are $POLICY 0 || fail "a process was restarted"
journalctl -u $POLICY -u hil-server -o cat | grep -E 'answers|shown' | tail -4
