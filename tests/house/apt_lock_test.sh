#!/bin/bash
# SPDX-License-Identifier: Apache-2.0
# Goal: ./dev waits for another apt and for nothing else. Method: apt_get as it stands in ./dev, before an apt-get that
# finds a lock taken twice, and one that fails for another reason; there is no real sleep.
set -eu
eval "$(sed -n '/^apt_get() {/,/^}/p' "$1/dev")"
log=$(mktemp)
trap 'rm -f "$log"' EXIT
as_root() { echo x >>"$log"; fake; }
sleep() { :; }

fake() {
  [ "$(wc -l <"$log")" -lt 3 ] || return 0
  echo "E: Could not get lock /var/lib/apt/lists/lock. It is held by process 4711 (apt-get)" >&2
  return 100
}
apt_get update || { echo "gave up though the lock was released"; exit 1; }
[ "$(wc -l <"$log")" = 3 ] || { echo "asked $(wc -l <"$log") times instead of 3"; exit 1; }

: >"$log"
fake() { echo "E: Unable to locate package unknown-to-apt" >&2; return 100; }
if apt_get install unknown-to-apt 2>/dev/null; then echo "took a failure for a success"; exit 1; fi
[ "$(wc -l <"$log")" = 1 ] || { echo "tried again what cannot succeed"; exit 1; }
