#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Takes the ELF kernel out of a bzImage that was packed with xz.

Usage: vmlinux.py BZIMAGE OUT. Source: Documentation/arch/x86/boot.rst, fields setup_sects, payload_offset, payload_length.
"""
import lzma
import pathlib
import struct
import sys

SECTOR = 512
XZ_MAGIC = b"\xfd7zXZ\0"


def main() -> None:
    image = pathlib.Path(sys.argv[1]).read_bytes()
    setup_sectors = image[0x1F1] or 4
    offset, length = struct.unpack_from("<II", image, 0x248)
    start = (setup_sectors + 1) * SECTOR + offset
    payload = image[start:start + length]
    if not payload.startswith(XZ_MAGIC):
        sys.exit(f"{sys.argv[1]}: the kernel inside is not packed with xz: teach this script its format")
    pathlib.Path(sys.argv[2]).write_bytes(lzma.LZMADecompressor().decompress(payload))


main()
