#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# How long a newcomer waits until the robot moves for the first time, by both of the README's roads:
#   clone    a fresh clone, an empty compiler cache, `./dev demo`
#   package  a bare Debian 12 (mmdebstrap), where apt fetches what the package depends on, and `takt run`
# Usage: first_motion.sh clone | first_motion.sh package TAKT_DEB (as root). Prints seconds; for the clone processor time too, as
# another load on the machine changes it least. Exit code 1: nothing moved within half an hour.
set -euo pipefail
folder=$(mktemp -d "${TMPDIR:-/tmp}/takt-first-motion.XXXXXX")
root=$folder/root
log=$folder/log
end() {
  for mounted in dev proc; do ! mountpoint -q "$root/$mounted" || umount -l "$root/$mounted"; done
  rm -rf --one-file-system "$folder"
}
trap end EXIT
inside() { env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive chroot "$root" "$@"; }
apt() { inside apt-get -qq -o APT::Sandbox::User=root -o Dpkg::Use-Pty=0 "$@" >>"$log" 2>&1; }

# until_it_moves COMMAND...: its output goes to the log; returns when the robot tracks.
until_it_moves() {
  "$@" >>"$log" 2>&1 &
  local runner=$!
  for _ in $(seq 18000); do
    ! grep -q '^ *[0-9.]* s  tracking' "$log" || return 0
    kill -0 $runner 2>/dev/null || break
    sleep 0.1
  done
  tail -n 20 "$log" >&2
  echo "nothing moved" >&2
  exit 1
}

case "$1" in
  clone)
    git clone -q "$(git rev-parse --show-toplevel)" "$folder/takt"
    cd "$folder/takt"
    began=$SECONDS
    CCACHE_DISABLE=1 until_it_moves ./dev demo
    echo "clone to first motion: $((SECONDS - began)) s"
    wait
    times >"$folder/times"
    awk 'NR == 2 { split($1 "m" $2, t, /[ms]+/); printf "processor time of all of it: %d s\n", t[1] * 60 + t[2] + t[3] * 60 + t[4] }' "$folder/times"
    ;;
  package)
    mmdebstrap -q --variant=minbase bookworm "$root"
    mount --bind /dev "$root/dev"
    mount -t proc proc "$root/proc"
    cp /etc/resolv.conf "$root/etc/resolv.conf"
    cp "$2" "$root/tmp/takt.deb"
    began=$SECONDS
    apt update
    apt install --no-install-recommends /tmp/takt.deb
    until_it_moves inside takt run /usr/share/takt/robots/arm6.yaml --arm --duration 5s --allow-non-realtime --runtime-dir /run/takt --run-dir /tmp/run
    echo "package to first motion: $((SECONDS - began)) s"
    wait
    ;;
esac
