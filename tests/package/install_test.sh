#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Goal: the package installs on a bare Debian 12 with its declared dependencies only, starts nothing, runs the demo
# robot, and leaves nothing but runs when purged; and with takt-dev's declared dependencies the example of an engine is built
# there and drives the demo robot. Method: mmdebstrap makes the bare system; in it, apt installs the
# package, `takt run` runs the packaged robot for some seconds, and the files before and after are compared.
# Usage: install_test.sh TAKT_DEB TAKT_DEV_DEB, as root, with Debian's mirror in reach. The bare system is kept in the cache for a day.
set -euo pipefail
deb=$(realpath "$1")
dev_deb=$(realpath "$2")
cache=${XDG_CACHE_HOME:-$HOME/.cache}/takt/package
base=$cache/bookworm.tar
root=$(mktemp -d "${TMPDIR:-/tmp}/takt-install.XXXXXX")
end() {
  for mounted in dev proc; do mountpoint -q "$root/$mounted" && umount -l "$root/$mounted"; done
  rm -rf --one-file-system "$root"
}
trap end EXIT
fail() { echo "FAILED: $*" >&2; exit 1; }
inside() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"; }
apt() { inside apt-get -qq -o APT::Sandbox::User=root -o Dpkg::Use-Pty=0 "$@" >"$root/tmp/apt.log" 2>&1 || { tail -20 "$root/tmp/apt.log" >&2; fail "apt-get $*"; }; }
# Everything but what apt, dpkg and the loader keep for themselves.
files() { (cd "$root" && find . -xdev \( -path ./proc -o -path ./dev -o -path ./tmp -o -path ./var/lib/dpkg -o -path ./var/lib/apt \
  -o -path ./var/cache -o -path ./var/log -o -path ./etc/ld.so.cache \) -prune -o -print | sort); }

mkdir -p "$cache"
[ -n "$(find "$base" -mtime -1 2>/dev/null)" ] || mmdebstrap -q --variant=minbase bookworm "$base"
tar -xf "$base" -C "$root"
mount --bind /dev "$root/dev"
mount -t proc proc "$root/proc"
cp /etc/resolv.conf "$root/etc/resolv.conf"
cp "$deb" "$root/tmp/takt.deb"
cp "$dev_deb" "$root/tmp/takt-dev.deb"
printf '#!/bin/sh\nexit 101\n' >"$root/usr/sbin/policy-rc.d" && chmod +x "$root/usr/sbin/policy-rc.d"

apt update
# The dependencies apart, so that what is compared below is the package's own doing.
apt install --no-install-recommends $(dpkg-deb -f "$deb" Depends | sed 's/([^)]*)//g; s/|[^,]*//g; s/,/ /g')
files >"$root/tmp/before"
apt install --no-install-recommends /tmp/takt.deb
inside takt --version
inside takt config check /etc/takt/robot/robot.yaml
! pgrep -f "^/usr/bin/takt" >/dev/null || fail "something was started"
inside getent passwd takt takt-policy takt-policy-fallback takt-policy-bridge >/dev/null || fail "the users are missing"
# 2 of `takt run`: it ended in a stop that was not asked for, which happens without real-time rights; of `takt replay`:
# some ticks could not be judged, all others reproduce.
may_end_with_2() { "$@" || [ $? -eq 2 ]; }
run_demo() { # RUN [OPTION...]
  may_end_with_2 inside takt run /etc/takt/robot/robot.yaml --arm --duration 5s --allow-non-realtime --runtime-dir /run/takt --run-dir "$@" >"$root/tmp/run.log" 2>&1 ||
    { cat "$root/tmp/run.log"; fail "the demo robot does not run"; }
  grep -q tracking "$root/tmp/run.log" || fail "the demo robot never tracked"
  may_end_with_2 inside takt replay "$1"
}
run_demo /var/lib/takt/runs/try

apt purge takt
files >"$root/tmp/after"
left=$(comm -13 "$root/tmp/before" "$root/tmp/after" | grep -v '^./var/lib/takt' || true)
# sysusers leaves users, on purpose: files of runs belong to them; passwd and its backup were there before.
left=$(grep -Ev '^./etc/(passwd-|group-|shadow-|gshadow-|\.pwd\.lock)$' <<<"$left" || true)
[ -z "$left" ] || fail "purging left behind: $left"
[ -d "$root/var/lib/takt/runs/try" ] || fail "purging removed a run"

apt install --no-install-recommends /tmp/takt.deb /tmp/takt-dev.deb
inside gcc -O2 -shared -fPIC -fvisibility=hidden /usr/share/doc/takt-dev/examples/own-engine/home_pose.c -o /tmp/home-pose.so >"$root/tmp/build.log" 2>&1 ||
  { cat "$root/tmp/build.log"; fail "the example does not build"; }
inside sed -i 's|^  file: .*onnx.*|&\n  engine: { name: /tmp/home-pose.so }|' /etc/takt/robot/robot.yaml
run_demo /tmp/own
apt install --no-install-recommends pkg-config cmake make
inside sh -c 'cd /tmp && cc -std=c11 /usr/share/doc/takt-dev/examples/c-policy/sway.c $(pkg-config --cflags --libs takt) -lm -o sway' ||
  fail "pkg-config's flags build no policy"
inside sh -c 'cmake -S /usr/share/doc/takt-dev/examples/c-policy -B /tmp/by-cmake && cmake --build /tmp/by-cmake' >"$root/tmp/build.log" 2>&1 ||
  { cat "$root/tmp/build.log"; fail "TaktConfig.cmake builds no policy"; }

# A robot in use that the new version refuses: nothing is unpacked, and the installed version stays whole.
inside sh -c 'mkdir /etc/takt/deployments/obsolete && ln -sfn deployments/obsolete /etc/takt/robot &&
  sed "s/^control:/&\n  overrun_limit: 50/" /usr/share/takt/demo/robot.yaml >/etc/takt/robot/robot.yaml'
! inside dpkg -i /tmp/takt.deb >"$root/tmp/upgrade.log" 2>&1 || fail "upgraded over a robot that the new version refuses"
grep -q 'control.overrun_limit: gone since version 0.2: write control.late_share' "$root/tmp/upgrade.log" || { cat "$root/tmp/upgrade.log"; fail "refused without its sentence"; }
[ "$(inside dpkg-query -W -f '${db:Status-Status}' takt)" = installed ] || fail "the refused upgrade left the package half installed"
inside sed -i /overrun_limit/d /etc/takt/robot/robot.yaml
inside dpkg -i /tmp/takt.deb >"$root/tmp/upgrade.log" 2>&1 || { cat "$root/tmp/upgrade.log"; fail "not upgraded although the robot in use is fine"; }
echo "installed, ran, purged: nothing is left but the run; the example engine of takt-dev was built, and ran; an upgrade asks first"
