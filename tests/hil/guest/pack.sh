#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Root, kernel modules and the rig's own files become what qemu starts: vmlinux, initrd, root.ext4.
# Usage: pack.sh ROOT.tar KERNEL_FOLDER OUT_FOLDER     needs root
set -euo pipefail
root_tar=$1 kernel=$(realpath "$2") out=$3 here=$(dirname "$(realpath "$0")")
version=$(cat "$kernel/version")
work=$(mktemp -d "${TMPDIR:-/tmp}/takt-hil-pack.XXXXXX")
trap 'rm -rf "$work"' EXIT
mkdir -p "$out" "$work/root" "$work/initrd"/{bin,dev,root,m}

root=$work/root
tar -x -f "$root_tar" -C "$root" --numeric-owner
mkdir -p "$root/usr/lib/modules" "$root/hil"
cp -a "$kernel/lib/modules/$version" "$root/usr/lib/modules/"
cp -a --no-preserve=ownership "$here/files/." "$root/"
echo hil >"$root/etc/hostname"
echo 0123456789abcdef0123456789abcdef >"$root/etc/machine-id"
echo '127.0.0.1 localhost hil' >"$root/etc/hosts"
systemctl --root="$root" -q set-default hil.target
# Everything that a guest of a few seconds does not need.
for unit in getty.target serial-getty@.service systemd-logind.service systemd-timesyncd.service systemd-update-utmp.service \
  systemd-update-utmp-runlevel.service systemd-random-seed.service systemd-remount-fs.service systemd-pstore.service \
  systemd-firstboot.service systemd-machine-id-commit.service systemd-binfmt.service systemd-journal-flush.service \
  systemd-journal-catalog-update.service systemd-update-done.service systemd-sysusers.service \
  systemd-boot-system-token.service sys-kernel-debug.mount sys-fs-fuse-connections.mount sys-kernel-config.mount \
  dev-hugepages.mount proc-sys-fs-binfmt_misc.automount modprobe@configfs.service modprobe@drm.service \
  modprobe@efi_pstore.service modprobe@fuse.service modprobe@dm_mod.service modprobe@loop.service \
  systemd-ask-password-console.path systemd-ask-password-wall.path systemd-tmpfiles-clean.timer \
  apt-daily.timer apt-daily-upgrade.timer dpkg-db-backup.timer e2scrub_all.timer fstrim.timer; do
  ln -sf /dev/null "$root/etc/systemd/system/$unit"
done
mke2fs -q -t ext4 -O ^has_journal,^metadata_csum,^64bit -E lazy_itable_init=1,root_owner=0:0 -m 0 -L hil -d "$root" \
  "$out/root.ext4" 1536M

initrd=$work/initrd
cp /bin/busybox "$initrd/bin/"
cp "$here/init" "$initrd/init"
chmod 755 "$initrd/init"
for name in nfit nd_pmem ext4; do
  modprobe -d "$kernel" -S "$version" --show-depends "$name" | sed -n 's/^insmod \([^ ]*\).*/\1/p'
done | awk '!seen[$0]++' | while read -r file; do
  cp "$file" "$initrd/m/"
  echo "/m/${file##*/}" >>"$initrd/modules"
done
(cd "$initrd" && find . | cpio -o -H newc --quiet) >"$out/initrd"
cp "$kernel/vmlinux" "$out/vmlinux"
