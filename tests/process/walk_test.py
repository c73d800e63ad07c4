#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a robot that falls by itself walks by its policy through Takt's processes, and stands when the policy is gone: the one in config/, and
a published one by its own published policy, from their published files and without an edit. What it did is judged by the plant, and every tick
replays. Method: walk.py lets it walk for some seconds at 0.5 m/s with the policy frozen for 300 ms on the way, then frozen for 2 s, then killed, then stopped by a person;
`published` takes Unitree's G1 as ../shared has it. Real time: it wants the machine for itself.
Usage: walk_test.py SOURCE_DIR BIN_DIR balancer|published
Exit codes: 0 fine, 1 not, 77 the published files are not there (1 with TAKT_REQUIRE_SHARED=1).
"""
import os
import pathlib
import subprocess
import sys
import tempfile


def main():
    source, programs = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    files = {"--robot": source / "config/balancer.yaml"}
    if sys.argv[3] == "published":
        shared = source.parent / "shared"
        files = {"--model": shared / "robots/g1/g1_29dof.xml", "--policy": shared / "policies/g1_velocity/policy.onnx",
                 "--deploy": shared / "policies/g1_velocity/deploy.yaml"}
    missing = [str(path) for path in files.values() if not path.exists()]
    if missing:
        print(f"SKIPPED: {', '.join(missing)} IS ABSENT: NO PUBLISHED ROBOT WALKED")
        return 1 if os.environ.get("TAKT_REQUIRE_SHARED") == "1" else 77
    words = [str(word) for pair in files.items() for word in pair]
    with tempfile.TemporaryDirectory() as folder:
        walk = pathlib.Path(folder) / "walk"
        done = subprocess.run([source / "tests/process/walk.py", *words, "--programs", programs, "--folder", walk, "--seconds", "8"], timeout=190)
        imported = walk / "robot.yaml"
        edits = imported.read_text().count("FILL_IN") if imported.exists() else 0
    if edits != 0:
        print(f"{edits} places of the imported robot file are left to fill in")
    return 0 if done.returncode == 0 and edits == 0 else 1


if __name__ == "__main__":
    sys.exit(main())
