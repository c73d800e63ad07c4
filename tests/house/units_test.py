#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: one duration has one unit for each kind of reader (docs/compatibility.md). Method: the names in JSON that programs and runs say, and the names of metrics,
as the sources spell them; a planted name of another unit must be found. Usage: units_test.py REPOSITORY
"""
import pathlib
import re
import sys

# Rooms whose JSON is a program's or a run's; a name in quotes that ends in the unit.
OF_PROGRAMS = ["cli/run", "cli/robot", "cli/top", "cli/evidence", "monitor", "executive/runtime"]
RECORDED = {"slept_ms"}  # a field of every record so far: a new name would be another field


def wrong_names(text):
    return [name for name in re.findall(r'"([a-z0-9_.]+_(?:ms|us|s|sec|seconds))"', text) if name not in RECORDED and not name.startswith("takt_") and not name.endswith("_per_s")]


def main():
    root = pathlib.Path(sys.argv[1])
    wrong = [f"{path.relative_to(root)}: {name}: whole nanoseconds, _ns" for room in OF_PROGRAMS for path in sorted((root / room).rglob("*.cpp"))
             for name in wrong_names(path.read_text())]
    for path in sorted((root / "monitor/telemetry").rglob("*.cpp")):
        wrong += [f"{path.relative_to(root)}: {name}: seconds" for name in re.findall(r'"(takt_[a-z0-9_]+_(?:ms|us|ns|milliseconds))"', path.read_text())]
    if wrong_names('{"tick_to_wire_ms", 3}') != ["tick_to_wire_ms"]:
        wrong.append("a planted name was not found")
    print("\n".join(wrong) or "every duration of programs and runs is told in its unit")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
