#!/bin/bash
# Goal: a new deployment is proven on the robot that systemd runs, and rollback brings the one before back.
# Method: the packaged demo robot, armed; its file with a slower joint is deployed: refused while armed, then, after a stop, started by takt.target, armed by
#   takt deploy and watched for a second. Refused again while that tracks; after a stop `takt rollback` goes back to the demo.
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
  within 10 "reset" takt reset --runtime-dir $RUN
}
takt deploy new.yaml --name early >early.txt 2>&1 && fail "deployed under a moving robot"
grep -q 'is armed' early.txt || fail "refused for another reason: $(cat early.txt)"
halt
takt deploy new.yaml --name new --simulated --arm --watch 1s --arm-within 20s --json >deploy.json 2>deploy.txt || fail "takt deploy: $(cat deploy.json deploy.txt)"
cat deploy.json
grep -q '"verdict":"proven"' deploy.json || fail "not proven"
[ "$(readlink /etc/takt/robot)" = deployments/new ] || fail "in use: $(readlink /etc/takt/robot)"
mode_is tracking || fail "mode $(field mode)"
takt rollback >rollback.txt 2>&1 && fail "rolled back under a moving robot"
halt
takt rollback >rollback.txt 2>&1 || fail "takt rollback: $(cat rollback.txt)"
cat rollback.txt
[ "$(readlink /etc/takt/robot)" = deployments/demo ] || fail "in use: $(readlink /etc/takt/robot)"
within 5 "standby" mode_is standby
