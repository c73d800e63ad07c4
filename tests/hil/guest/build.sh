#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# The guest, cached by content: prints the folder with vmlinux, initrd and root.ext4.
# Usage: build.sh CACHE_FOLDER [PACKAGE...]     PACKAGE: what the guest holds beside packages.list; needs root to build
# A newer Debian package, another list or script gives another key. The three newest of each kind are kept.
set -euo pipefail
here=$(dirname "$(realpath "$0")") cache=$(realpath -m "$1")
shift
mapfile -t packages < <({ sed 's/#.*//;/^ *$/d' "$here/packages.list"; printf '%s\n' "$@"; } | sed '/^$/d' | sort -u)
key() { sha256sum | cut -c1-16; }
versions() { apt-cache policy "$@" | sed -n 's/^ *Candidate: //p;/^[^ ]/p'; }
root_key=$({ versions "${packages[@]}"; cat "$here/root.sh"; } | key)
kernel_key=$({ versions linux-image-rt-amd64; cat "$here/kernel.sh" "$here/vmlinux.py" "$here/modules.list"; } | key)
own_key=$({ echo "$root_key $kernel_key"; cat "$here/pack.sh" "$here/init"; tar -c -C "$here" --sort=name --mtime=@0 --owner=0 --group=0 files; } | key)

# new=PATH once NAME COMMAND...: COMMAND makes PATH, which becomes $cache/NAME: all of it or nothing.
once() {
  local made=$cache/$1 started=$SECONDS
  shift
  [ -e "$made" ] && { touch "$made"; return; }
  rm -rf "$new"
  "$@" >&2
  mv "$new" "$made"
  echo "hil: made ${made##*/} in $((SECONDS - started)) s" >&2
}
prune() { find "$cache" -maxdepth 1 -name "$1-*" -printf '%T@ %p\n' | sort -rn | tail -n +4 | cut -d' ' -f2- | xargs -r rm -rf; }

mkdir -p "$cache"
exec 9>"$cache/lock"
flock 9
new=$cache/new.root.tar once "root-$root_key.tar" "$here/root.sh" "$cache/new.root.tar" "$cache/debs" "${packages[@]}"
new=$cache/new.kernel once "kernel-$kernel_key" "$here/kernel.sh" "$cache/new.kernel" "$cache/debs" "$here/modules.list"
new=$cache/new.image once "image-$own_key" "$here/pack.sh" "$cache/root-$root_key.tar" "$cache/kernel-$kernel_key" "$cache/new.image"
for kind in root kernel image; do prune "$kind"; done
# qemu opens the image for writing, although it writes to a copy: it belongs to the user who asked.
[ -z "${SUDO_UID:-}" ] || chown -R "$SUDO_UID:$SUDO_GID" "$cache"
echo "$cache/image-$own_key"
