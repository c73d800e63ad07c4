#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: builds whose shared structures differ in anything that a reader relies on have different contract hashes.
Method: a copy of executive/contract in which two fields, two words of an enum or two structures have each other's name
is compiled into a program that prints its hash. A field without its line in the table must not compile.

Arguments: source folder, compiler."""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

source, compiler = pathlib.Path(sys.argv[1]), sys.argv[2]
PROGRAM = """#include <cstdio>
#include "executive/contract/contract_layout.hpp"
int main() { std::printf("%llx", static_cast<unsigned long long>(takt::contract_layout())); }
"""
EXCHANGES = [
    ("feedback.hpp", "q", "dq", "a joint's position and velocity"),
    ("tick_record.hpp", "kp_command", "kd_command", "stiffness and damping"),
    ("feedback.hpp", "tx_dropped", "rx_dropped", "two counters"),
    ("mode.hpp", "bus_off", "bus_down", "two causes"),
    ("mode.hpp", "tracking", "degraded", "two modes"),
    ("tick_record.hpp", "fallback", "candidate", "two records inside the record"),
    ("intervention.hpp", "torque_limit", "velocity_limit", "two interventions, bits of a mask"),
    ("session.hpp", "status", "arm", "two requests of a person"),
    ("observation.hpp", "q", "q_setpoint", "sensed and commanded positions"),
]


def built(change):
    """What the program prints after change(folder); the compiler's words where it does not compile."""
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        shutil.copytree(source / "executive/contract", folder / "executive/contract")
        change(folder / "executive/contract")
        (folder / "print.cpp").write_text(PROGRAM)
        made = subprocess.run([compiler, "-std=c++23", "-I", folder, folder / "print.cpp", "-o", folder / "print"],
                              capture_output=True, text=True)
        if made.returncode != 0:
            return None, made.stderr
        return subprocess.run([folder / "print"], capture_output=True, text=True, check=True).stdout, ""


def exchanged(file, one, other):
    def change(folder):
        text = (folder / file).read_text()
        words = {one: other, other: one}
        changed = re.sub(rf"\b({one}|{other})\b", lambda match: words[match[0]], text)
        assert changed != text, f"{file} has neither {one} nor {other}"
        (folder / file).write_text(changed)
    return change


def without_line(file, line):
    def change(folder):
        text = (folder / file).read_text()
        (folder / file).write_text(text.replace(line, "", 1))
    return change


failures = []
hash_of_all, said = built(lambda folder: None)
assert hash_of_all, said
for file, one, other, what in EXCHANGES:
    its, said = built(exchanged(file, one, other))
    if its is None:
        failures.append(f"{what}: the exchanged contract does not compile:\n{said[-600:]}")
    elif its == hash_of_all:
        failures.append(f"{what} exchanged ({one}, {other}): same hash {its}")
for file, line in [("tick_record.hpp", "TAKT_FIELD(slept_ms),"), ("feedback.hpp", "TAKT_FIELD(casing_C),"),
                   ("observation.hpp", "TAKT_FIELD(imu),")]:
    if line not in (source / "executive/contract" / file).read_text():
        failures.append(f"{file} has no `{line}`")
        continue
    its, said = built(without_line(file, line))
    if its is not None:
        failures.append(f"{file} without `{line}` compiles")
    elif "has no line in fields_of()" not in said:
        failures.append(f"{file} without `{line}`: the compiler does not say what is missing:\n{said[-600:]}")
print("\n".join(failures) or f"{len(EXCHANGES)} exchanges change the hash")
sys.exit(1 if failures else 0)
