#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: a new deployment is proven on the robot that systemd runs, and rollback brings the one before back; an upgrade waits for a disarmed robot.
# Method: the packaged demo robot, armed; its file with a slower joint is deployed: refused while armed, then, after a stop, started by takt.target, armed by
#   takt deploy and watched for a second. Refused again while that tracks; after a stop `takt rollback` goes back to the demo. The package's own
#   scripts are called as dpkg does when it upgrades: refused under an armed robot, and the disarmed one is another process afterwards.
# Mode: virtual
# Limit: 110 s
# Planted fault: a policy host that ends at once: the deployment goes back.
# Planted by: /^takt deploy/i drop_in $POLICY.service Service ExecStart= ExecStart=/bin/false
. "$HIL_LIB/hil.sh"
takt_up
tracking
sed 's/velocity: 3 rad/velocity: 2.5 rad/' $ROBOT >new.yaml
halt() {
  takt stop --runtime-dir $RUN
  within 10 "reset" was_reset
}
takt deploy new.yaml --name early >early.txt 2>&1 && fail "deployed under a moving robot"
grep -q 'is armed' early.txt || fail "refused for another reason: $(cat early.txt)"
halt
takt deploy new.yaml --name new --simulated --arm --watch 1s --arm-within 20s --json >deploy.json 2>deploy.txt || fail "takt deploy: $(cat deploy.json deploy.txt)"
cat deploy.json
grep -q '"verdict":"proven"' deploy.json || fail "not proven"
[ "$(readlink /etc/takt/robot)" = deployments/new ] || fail "in use: $(readlink /etc/takt/robot)"
[ "$(readlink $RUN/.robot)" = /etc/takt/deployments/new ] || fail "started for: $(readlink $RUN/.robot)"
mode_is tracking || fail "mode $(field mode)"
scripts=/var/lib/dpkg/info/takt
$scripts.preinst upgrade 0.0 2>upgrade.txt && fail "upgraded under a moving robot"
grep -q 'is armed' upgrade.txt || fail "not upgraded for another reason: $(cat upgrade.txt)"
takt rollback >rollback.txt 2>&1 && fail "rolled back under a moving robot"
halt
takt rollback >rollback.txt 2>&1 || fail "takt rollback: $(cat rollback.txt)"
cat rollback.txt
[ "$(readlink /etc/takt/robot)" = deployments/demo ] || fail "in use: $(readlink /etc/takt/robot)"
within 5 "standby" mode_is standby
before=$(main_pid takt-executive)
$scripts.preinst upgrade 0.0 || fail "not upgraded although disarmed"
$scripts.postinst configure 0.0 || fail "postinst"
within 10 "standby after the upgrade" mode_is standby
[ "$(main_pid takt-executive)" != "$before" ] || fail "the old executive runs on"
# The log of interventions has all of it, and what the new robot file changed (docs/duties.md).
log=$(ls /var/lib/takt/interventions/*.jsonl) || fail "no log of interventions"
[ "$(stat -c %U:%G "$log")" = takt:takt ] || fail "the log is of $(stat -c %U:%G "$log")"
for what in start arm "press stop" reset deploy rollback; do
  grep -q "\"what\":\"$what\"" "$log" || fail "no $what in the log of interventions: $(cat "$log")"
done
grep '"what":"start"' "$log" | grep -q 'velocity"[^}]*"after":"2.5' || fail "the changed limit is not in the log: $(cat "$log")"
