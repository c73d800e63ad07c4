#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a programming error in what is installed costs as little as the compiler can make it, and no symbol is looked up
while a program runs: inside the loop that is time that was not planned. Method: what each ELF file says of itself.
  hardening_test.py FILE...
"""
import re
import subprocess
import sys


def told(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def lacks(path):
    header, segments = told("readelf", "-hW", path), told("readelf", "-lW", path)
    dynamic, symbols = told("readelf", "-dW", path), told("readelf", "--dyn-syms", "-W", path)
    if not re.search(r"Type:\s+DYN", header):
        yield "it lies at one fixed address: compile it with -fPIE"
    if "GNU_RELRO" not in segments or not re.search(r"BIND_NOW|FLAGS_1.*NOW", dynamic):
        yield "its table of functions can be written to, and is filled while it runs: link it with -z relro -z now"
    if "GNU_STACK" in segments and re.search(r"GNU_STACK.*RWE", segments):
        yield "its stack can be executed"
    if "__stack_chk_fail" not in symbols:
        yield "nothing watches its stack: compile it with -fstack-protector-strong"


def main():
    files = sys.argv[1:]
    faults = [f"{path}: {fault}" for path in files for fault in lacks(path)]
    checked = [path for path in files if re.search(r"__\w+_chk@", told("readelf", "--dyn-syms", "-W", path))]
    # One whose every size is known when it is compiled needs no check.
    if 2 * len(checked) < len(files):
        faults.append(f"{len(checked)} of {len(files)} check sizes in the C library: compile with -D_FORTIFY_SOURCE=3")
    print("\n".join(faults) or f"{len(files)} files, {len(checked)} of them check sizes in the C library")
    return 1 if faults or not files else 0


sys.exit(main())
