# SPDX-License-Identifier: Apache-2.0
# What cases share: source it first. In the guest, as root. `. "$HIL_LIB/hil.sh"`
# Time here is the guest's: under virtual time a wait costs nothing, and a time that was measured is the same on any host.
set -uo pipefail

ROBOT=/etc/takt/robot/robot.yaml
RUN=/run/takt
# Every call of takt would read all libraries' headers for a trace that is not taken.
export LTTNG_UST_WITHOUT_BADDR_STATEDUMP=1
PLANT=hil-plant  # the device side of the buses: not a part of what is tested
POLICY=takt-policy-host@robot

fail() {
  echo "FAIL: $*"
  exit 1
}
say() { echo "$*"; }

# holds EXPRESSION: of numbers with fractions, such as `holds "$a < 0.5"`.
holds() { awk "BEGIN { exit !($1) }"; }
now() { cut -d' ' -f1 /proc/uptime; }

# within SECONDS WHAT COMMAND...: polls four times a second until the command succeeds; fails the case when it does not. Polls
# are counted, not time, so that a host that stalls while a paced guest waits takes none away.
within() {
  local limit=$1 what=$2 polls
  shift 2
  polls=$(awk "BEGIN { print $limit * 4 }")
  until "$@" >/dev/null 2>&1; do
    ((polls-- > 0)) || fail "$what: not within $limit s; $(takt status --runtime-dir $RUN 2>&1; cat answer.txt 2>/dev/null)"
    sleep 0.25
  done
}

# drop_in UNIT SECTION SETTING...: of the unit as installed, until the guest ends.
drop_in() {
  local unit=$1 section=$2
  shift 2
  mkdir -p "/run/systemd/system/$unit.d"
  { echo "[$section]" && printf '%s\n' "$@"; } >"/run/systemd/system/$unit.d/hil-$section.conf"
  systemctl daemon-reload
}

# can_up INTERFACE...: virtual CAN interfaces that carry classic and FD frames.
can_up() {
  local name
  for name in "$@"; do
    ip link add dev "$name" type vcan && ip link set "$name" mtu 72 txqueuelen 1000 up || fail "no interface $name"
  done
}

# robot NAME [SED_EXPRESSION...]: puts config/NAME.yaml in use, on vcan instead of can, with no interface optional.
robot() {
  local name=$1 expression changes=()
  shift
  for expression in "$@"; do changes+=(-e "$expression"); done
  mkdir -p /etc/takt/deployments/hil
  ln -sfn deployments/hil /etc/takt/robot
  cp "$HIL_LIB"/robots/*.onnx /etc/takt/deployments/hil/
  sed -E -e 's/interface: can/interface: vcan/; s/when_missing: loopback/when_missing: refuse/; s/^  cpu: 1 .*/  cpu: none/' \
    -e 's|directory: runs$|directory: /var/lib/takt/runs|' "${changes[@]}" "$HIL_LIB/robots/$name.yaml" >$ROBOT
  takt config check $ROBOT >config.txt 2>&1 || fail "$(cat config.txt)"
}

# plant [OPTION...]: drives, mechanics and camera, at a priority below the executive's; on the interfaces of PLANT_ROBOT, if
# that is another file.
plant() {
  systemd-run --quiet --unit $PLANT --uid takt --gid takt -p AmbientCapabilities=CAP_SYS_NICE -p LimitRTPRIO=20 \
    takt-plant --robot "${PLANT_ROBOT:-$ROBOT}" --runtime-dir $RUN --policy-user takt-policy "$@" || fail "the plant does not start"
  within 5 "the plant" is_active $PLANT
}

# field NAME: of the executive's status, as text; empty while no executive answers. Its newest incident has names of its own.
field() { takt status --runtime-dir $RUN --json 2>/dev/null | sed 's/"incident":{[^}]*}//' | grep -oE "\"$1\":(\"[^\"]*\"|[^,}]*)" | cut -d: -f2- | tr -d '"'; }
mode_is() { [ "$(field mode)" = "$1" ]; }
main_pid() { systemctl show -P MainPID "$1"; }
is_active() { systemctl is-active -q "$1"; }
restarts_are() { [ "$(systemctl show -P NRestarts "$1")" = "$2" ] && is_active "$1"; }

takt_up() {
  systemctl start takt.target || fail "systemctl start takt.target"
  within 10 "takt-executive" is_active takt-executive
  within 10 "$POLICY" is_active "$POLICY"
  within 10 "standby" mode_is standby
}
armed() { takt arm --runtime-dir $RUN >answer.txt 2>&1; }
was_reset() { takt reset --runtime-dir $RUN >answer.txt 2>&1; }
# A person looks where the joints stand, accepts it by a reset in standby, and arms: drives were silent while a plant or
# an adapter was away.
looked_and_armed() {
  takt reset --runtime-dir $RUN >/dev/null 2>&1
  armed
}
tracking() {
  within 10 "arming" looked_and_armed
  within 5 "tracking" mode_is tracking
}

# The common beginning: arm6 on two virtual interfaces, tracking.
tracking_arm6() {
  can_up vcan0 vcan1
  robot arm6
  plant
  takt_up
  tracking
}
# A person lifts the arm to where it began: the simulated one sags while its drives do no more than damp.
lift() { systemctl restart $PLANT || fail "the plant does not start again"; }
# Back to standby after a stop or fault, and tracking again.
recover() {
  # What hangs on a lost joint sags by damping alone, and reset waits until it rests.
  within 30 "reset" was_reset
  within 5 "standby after reset" mode_is standby
  lift
  tracking
}

# transitions FROM TO CAUSE: how many such changes of mode are recorded.
transitions() { cat /var/lib/takt/runs/*/transitions.jsonl 2>/dev/null | grep -c "\"from\":\"$1\",\"to\":\"$2\",\"cause\":\"$3\""; }
happened() { [ "$(transitions "$1" "$2" "$3")" -gt 0 ]; }
# stopped_by CAUSE: a damped stop for that reason, from whatever mode.
stopped_by() { grep -q "\"to\":\"damped_stop\",\"cause\":\"$1\"" /var/lib/takt/runs/*/transitions.jsonl; }
# age_at FROM TO CAUSE: ms, the command's age at the newest such change.
age_at() {
  cat /var/lib/takt/runs/*/transitions.jsonl | grep "\"from\":\"$1\",\"to\":\"$2\",\"cause\":\"$3\"" | tail -1 |
    sed 's/.*"age_ns":\([0-9]*\).*/\1/' | awk '{ print $1 / 1e6 }'
}
overruns() {
  takt status --runtime-dir $RUN --json | grep -o '"overruns":{[^}]*}' | grep -oE ':[0-9]+' | tr -d : | awk '{ sum += $1 } END { print sum }'
}
# no_overrun_in TICKS WHAT: lets that many periods pass; none may be late or skipped.
no_overrun_in() {
  local until=$(($(field tick) + $1))
  while [ "$(field tick)" -lt "$until" ]; do sleep 1; done
  [ "$(overruns)" = 0 ] || fail "$2: $(overruns) overruns: $(takt status --runtime-dir $RUN)"
  [ "$(field skipped_periods)" = 0 ] || fail "$2: $(field skipped_periods) periods skipped"
  say "$2: 0 of $1 periods missed"
}
active_cause() { takt status --runtime-dir $RUN --json 2>/dev/null | grep -o '"causes_active":[^]]*' | grep -q "\"$1\""; }
no_active_cause() { field tick | grep -q . && ! active_cause "$1"; }
