#!/usr/bin/env bash
# SPDX-License-Identifier: Apache-2.0
# Debian's PREEMPT_RT kernel for the guest: an ELF vmlinux and a few of its modules.
# Usage: kernel.sh OUT_FOLDER DEB_CACHE MODULES.LIST
# OUT_FOLDER gets: version, vmlinux, lib/modules/VERSION with modules.dep. The kernel is not installed on the host.
set -euo pipefail
out=$(realpath -m "$1") cache=$(realpath -m "$2") list=$(realpath "$3") here=$(dirname "$(realpath "$0")")
package=$(apt-cache depends --important linux-image-rt-amd64 | sed -n 's/^ *Depends: \(linux-image-[0-9].*\)$/\1/p' | head -1)
version=${package#linux-image-}
mkdir -p "$out" "$cache"
deb() { find "$cache" -name "${package}_*.deb" | head -1; }
[ -n "$(deb)" ] || (cd "$cache" && apt-get -q -o APT::Sandbox::User=root download "$package")

unpacked=$(mktemp -d "${TMPDIR:-/tmp}/takt-hil-kernel.XXXXXX")
trap 'rm -rf "$unpacked"' EXIT
dpkg-deb --fsys-tarfile "$(deb)" | tar -x -C "$unpacked" --exclude=./usr --exclude='*/sound' \
  --exclude='*/drivers/gpu' --exclude='*/drivers/media' --exclude='*/drivers/infiniband' --exclude='*/drivers/scsi'
# Started as ELF: emulated, the decompression alone takes seconds.
"$here/vmlinux.py" "$unpacked/boot/vmlinuz-$version" "$out/vmlinux"
depmod -b "$unpacked" "$version"

modules=$out/lib/modules/$version
mkdir -p "$modules"
cp "$unpacked/lib/modules/$version"/modules.{builtin,builtin.modinfo,order} "$modules"
for name in $(sed 's/#.*//' "$list") nfit nd_pmem ext4; do
  modprobe -d "$unpacked" -S "$version" --show-depends "$name" | sed -n 's/^insmod \([^ ]*\).*/\1/p'
done | sort -u | while read -r file; do
  install -D -m 644 "$file" "$modules/${file#*/lib/modules/"$version"/}"
done
depmod -b "$out" "$version"
echo "$version" >"$out/version"
