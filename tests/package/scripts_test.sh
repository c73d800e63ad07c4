#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Goal: the maintainer scripts do what they say, twice over, and never start or enable anything. Method: they run on a
# folder in place of /, with systemctl and its kin replaced by recorders. Usage: scripts_test.sh SCRIPTS_DIR CHECK_ROBOT
set -euo pipefail
scripts=$1 check_robot=$2
root=$(mktemp -d)
by_hand=
trap '[ -z "$by_hand" ] || kill "$by_hand"; rm -rf "$root"' EXIT
fail() { echo "FAILED: $*" >&2; exit 1; }

mkdir -p "$root/bin" "$root/etc/takt" "$root/usr/share/takt/demo" "$root/run/systemd/system"
for tool in systemctl systemd-sysusers systemd-tmpfiles; do
  printf '#!/bin/sh\necho %s "$@" >>"%s/said"\n' "$tool" "$root" >"$root/bin/$tool"
done
# The executive runs unless `is-stopped` is there; takt prints what `status` holds.
printf '#!/bin/sh\necho systemctl "$@" >>"%s/said"\ncase "$*" in *is-active*) [ ! -e %s/is-stopped ] ;; esac\n' "$root" "$root" >"$root/bin/systemctl"
printf '#!/bin/sh\ncat %s/status\n' "$root" >"$root/bin/takt"
# Executives that run: those of `executives`.
printf '#!/bin/sh\ncat %s/executives\n' "$root" >"$root/bin/pidof"
: >"$root/executives"
chmod +x "$root"/bin/*
# The scripts name absolute paths; here these begin at the folder.
run() { # SCRIPT ARGUMENTS
  sed -E "s#(^|[ '\"])/(etc|run|var|usr)/#\1$root/\2/#g" "$scripts/$1" >"$root/script"
  : >"$root/said"
  PATH=$root/bin:$PATH sh "$root/script" "${@:2}"
}
said() { grep -q "$1" "$root/said"; }
never_starts() { ! grep -Eq 'systemctl.* (start|restart|enable)' "$root/said" || fail "$1 starts a robot: $(cat "$root/said")"; }

run postinst configure
[ "$(readlink "$root/etc/takt/robot")" = deployments/demo ] || fail "no demo robot"
[ "$(readlink -f "$root/etc/takt/robot")" = "$root/usr/share/takt/demo" ] || fail "the demo robot is not the packaged one"
said 'systemd-sysusers takt.conf' && said 'systemd-tmpfiles --create takt.conf' && said 'daemon-reload' || fail "set-up: $(cat "$root/said")"
never_starts postinst

ln -sfn deployments/mine "$root/etc/takt/robot" # points nowhere, yet it is the owner's
run postinst configure 0.1.0-1
[ "$(readlink "$root/etc/takt/robot")" = deployments/mine ] || fail "an upgrade changed the robot in use"
never_starts "an upgrade"
said 'try-restart takt-\*.service' || fail "after an upgrade the old executive runs on"

run prerm upgrade 0.2.0-1
[ ! -s "$root/said" ] || fail "the old package's prerm touches a running robot: $(cat "$root/said")"
echo '{"drives_enabled":false}' >"$root/status"
run preinst upgrade 0.1.0-1 || fail "an upgrade is refused although the robot is not armed"
! said stop || fail "an upgrade stops a robot"
for status in '{"drives_enabled":true}' ''; do
  echo "$status" >"$root/status"
  ! run preinst upgrade 0.1.0-1 2>"$root/refusal" || fail "upgraded under an armed robot ($status)"
  grep -q 'is armed' "$root/refusal" || fail "an upgrade is refused without a reason"
done
echo '{"drives_enabled":false}' >"$root/status"
touch "$root/is-stopped"
# A robot that was started by hand.
python3 -c 'import signal; signal.pause()' takt-executive --runtime-dir "$root/by-hand" >/dev/null 2>&1 </dev/null &
by_hand=$!
echo "$by_hand" >"$root/executives"
run preinst upgrade 0.1.0-1 || fail "an upgrade is refused although the robot that was started by hand is not armed"
echo '{"drives_enabled":true}' >"$root/status"
! run preinst upgrade 0.1.0-1 2>"$root/refusal" || fail "upgraded under a robot that was started by hand"
grep -q "process $by_hand runs a robot that is armed" "$root/refusal" || fail "refused otherwise: $(cat "$root/refusal")"
: >"$root/executives"
rm "$root/is-stopped"
echo '{"drives_enabled":false}' >"$root/status"

# What the new version does not take is refused before anything is unpacked, with its sentence. The script lies beside its checker.
cp "$check_robot" "$root/check-robot"
mkdir "$root/etc/takt/deployments/obsolete"
ln -sfn deployments/obsolete "$root/etc/takt/robot"
demo=$scripts/../../config/arm6.yaml
obsolete() { # FROM TO: as sed has them
  sed "s|file: arm6_reach.onnx|file: $(realpath "$scripts/../../config/arm6_reach.onnx")|; $1" "$demo" >"$root/etc/takt/robot/robot.yaml"
}
obsolete ''
run preinst upgrade 0.1.0-1 || fail "an upgrade is refused although the robot in use is taken"
for change in 's/^  wake: .*/&\n  overrun_limit: 50/; s/^control:/&\n  overrun_limit: 50/' 's/^robot: /no_such_key: 1\n&/' 's/^schema: .*/schema: takt.robot\/9/' \
  's/^freshness:/stops: { command_lost: { how: posture } }\n&/' 's/max_age: .*/max_age: 3 parsecs/'; do
  obsolete "$change"
  ! run preinst upgrade 0.1.0-1 2>"$root/refusal" || fail "upgraded over a robot file that is refused: $change"
  grep -q 'nothing was upgraded, for this version refuses the robot in use' "$root/refusal" && grep -q 'robot.yaml:' "$root/refusal" ||
    fail "refused without its sentence: $(cat "$root/refusal")"
done
ln -sfn deployments/mine "$root/etc/takt/robot"
rm "$root/check-robot"

run preinst install || fail "a first installation is refused"
touch "$root/is-stopped"
run preinst upgrade 0.1.0-1 || fail "an upgrade is refused although no executive runs"
run prerm remove
said 'stop takt.target' || fail "removing leaves the robot running"

wants=$root/etc/systemd/system/multi-user.target.wants
mkdir -p "$wants" "$root/run/takt" "$root/var/lib/takt/runs/one"
ln -s /usr/lib/systemd/system/takt.target "$wants/takt.target"
ln -s /usr/lib/systemd/system/ssh.service "$wants/ssh.service"
ln -s /usr/lib/systemd/system/taktile-hvac.service "$wants/taktile-hvac.service"
for unit in "$scripts"/../../systemd/takt*.service; do
  name=$(basename "$unit")
  ln -s "/usr/lib/systemd/system/$name" "$wants/${name/@/@one}"
done
run postrm remove
[ -e "$root/etc/takt/robot" ] || [ -L "$root/etc/takt/robot" ] || fail "removing is not purging"
run postrm purge
[ ! -e "$root/run/takt" ] && [ "$(ls "$wants")" = "$(printf 'ssh.service\ntaktile-hvac.service')" ] || fail "purging leaves, or takes, a unit: $(ls "$wants")"
[ "$(cd "$root/etc/takt" && find . -type f)" = ./deployments/obsolete/robot.yaml ] && [ ! -L "$root/etc/takt/robot" ] ||
  fail "purging takes what a person deployed, or leaves what is ours: $(find "$root/etc/takt")"
rm -r "$root/etc/takt/deployments/obsolete"
run postrm purge
[ ! -e "$root/etc/takt" ] || fail "purging leaves something of ours: $(find "$root/etc/takt")"
[ -d "$root/var/lib/takt/runs/one" ] || fail "purging removed recorded runs"
rm -r "$root/var/lib/takt/runs/one"
run postrm purge
[ ! -e "$root/var/lib/takt" ] || fail "without runs nothing should be left"
echo "the maintainer scripts do what they say"
