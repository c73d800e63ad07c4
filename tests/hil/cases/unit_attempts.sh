#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: a policy under its unit is a policy and nothing else, and each has a user of its own: no other policy's seat, process or file is its.
# Method: a hostile program in the policy host's place makes its attempts (lib/unit_attempts.py); hosts of another policy's user ask for its seat; root
#   runs a candidate beside.
# Mode: virtual
# Limit: 90 s
# Planted fault: the policy host runs as the executive's user.
# Planted by: s/StandardOutput=/User=takt &/
# Planted fault: the policy host has the machine's files.
# Planted by: s/StandardOutput=/ProtectSystem=no InaccessiblePaths= &/
. "$HIL_LIB/hil.sh"
tracking_arm6
takt policy shadow /etc/takt/deployments/hil/arm6_reach.onnx --runtime-dir $RUN --robot $ROBOT >shadow.txt 2>&1 &
shadow=$!
within 20 "a candidate of root's" eval '[ "$(field candidate_pid)" -gt 0 ] 2>/dev/null'
candidate=$(stat -c %u "/proc/$(field candidate_pid)")
[ "$candidate" -ge 1879048192 ] || fail "the candidate is user $candidate"
kill -INT $shadow
wait $shadow

systemctl stop $POLICY
systemd-run --quiet --unit hil-other --uid takt-policy-fallback --gid takt takt-policy-host --robot $ROBOT --runtime-dir $RUN
within 10 "another policy's user is refused its seat" eval "journalctl -u hil-other -o cat | grep -q \"is another policy's and may not be policy\""
systemctl stop hil-other

systemd-run --quiet --unit hil-bystander --uid takt-policy-fallback --gid takt sleep infinity
cp "$HIL_LIB/unit_attempts.py" /run/unit_attempts.py && chmod 644 /run/unit_attempts.py
drop_in $POLICY.service Service Type=oneshot Restart=no StandardOutput=file:/run/attempts.txt ExecStart= \
  "ExecStart=/usr/bin/python3 /run/unit_attempts.py $(main_pid takt-executive) $(main_pid takt-monitor) $(main_pid hil-bystander) vcan0"
systemctl start $POLICY || fail "the attempts did not end: $(cat /run/attempts.txt; journalctl -u $POLICY -o cat | tail -5)"
cat /run/attempts.txt
grep -q '^attempts: all made' /run/attempts.txt || fail "not all were made"
! grep 'got through$' /run/attempts.txt || fail "they got through"
is_active takt-executive && restarts_are takt-executive 0 && is_active hil-bystander || fail "a process did not live through it"
