#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: what lives in other people's processes, or runs before an upgrade is unpacked, needs few libraries: none of tracing, which starts
threads, none of GPIO, none of a log. Method: what the linker wrote into the client library and into the program that judges robot files.
Usage: libraries_test.py LIBRARY_OR_PROGRAM...
"""
import re
import subprocess
import sys

ALLOWED = r"lib(yaml-cpp|crypto|fmt|stdc\+\+|m|gcc_s|c)\.so\S*"


def needed(file):
    said = subprocess.run(["readelf", "--dynamic", "--wide", file], stdout=subprocess.PIPE, text=True, check=True).stdout
    return re.findall(r"\(NEEDED\).*\[(.*)\]", said)


def main():
    for file in sys.argv[1:]:
        libraries = needed(file)
        if "libc.so.6" not in libraries:
            return f"{file}: the dynamic section cannot be read: {libraries}"
        if further := [name for name in libraries if not re.fullmatch(ALLOWED, name)]:
            return f"{file} needs {', '.join(further)}"
    return 0


if __name__ == "__main__":
    sys.exit(main())
