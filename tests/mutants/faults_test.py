#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a change of the code does not leave a fault of faults.toml behind. Method: what each fault looks for stands in the function
that it names, read as text, which takes no build; then one that names another function is planted and must be found. That it stands there
once, and only there, `./dev mutants` says.
"""
import pathlib
import re
import sys
import tomllib

HERE = pathlib.Path(__file__).resolve().parent
TOP = HERE.parent.parent


def bodies(source, function):
    """From each place where that name may be defined to the brace that closes what is there."""
    for found in re.finditer(rf"^( *)([^\n]*[^\n.>])?\b{re.escape(function.split('::')[-1])}\(", source, re.M):
        end = source.find(f"\n{found[1]}}}", found.start())
        yield source[found.start():end if end > 0 else len(source)]


def lost(fault, source):
    return not any(fault["find"] in body for body in bodies(source, fault["function"]))


def main():
    faults = tomllib.loads((HERE / "faults.toml").read_text())["fault"]
    sources = {fault["file"]: (TOP / fault["file"]).read_text() for fault in faults}
    problems = [f"faults.toml: `{fault['name']}`: {fault['find']!r} is not in {fault['function']} of {fault['file']}: follow what it says now"
                for fault in faults if lost(fault, sources[fault["file"]])]
    print("\n".join(problems))
    planted = {**faults[0], "function": "of_another_name"}
    assert lost(planted, sources[planted["file"]]), "a planted fault was not found"
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
