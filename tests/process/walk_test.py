#!/usr/bin/env python3
"""Goal: somebody else's robot walks by somebody else's policy through Takt's processes, from their published files and without an edit;
what it did is judged by the plant, and every tick replays. Method: Unitree's G1 as ../shared has it, through walk.py: 8 s at 0.5 m/s with
the policy frozen for 300 ms on the way. A machine too busy for real time gets three tries. Usage: walk_test.py SOURCE_DIR BIN_DIR
Exit codes: 0 fine, 1 not, 77 the published files are not there.
"""
import pathlib
import subprocess
import sys
import tempfile

TRIES = 3


def main():
    source, programs = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    shared = source.parent / "shared"
    files = {"--model": shared / "robots/g1/g1_29dof.xml", "--policy": shared / "policies/g1_velocity/policy.onnx",
             "--deploy": shared / "policies/g1_velocity/deploy.yaml"}
    missing = [str(file) for file in files.values() if not file.exists()]
    if missing:
        print(f"SKIPPED: {', '.join(missing)} IS ABSENT: NO PUBLISHED ROBOT WALKED")
        return 77
    words = [str(word) for pair in files.items() for word in pair]
    for attempt in range(TRIES):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([source / "tests/process/walk.py", *words, "--programs", programs, "--folder", pathlib.Path(folder) / "walk",
                                   "--seconds", "8", "--walk-only"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=150)
            edits = (pathlib.Path(folder) / "walk/robot.yaml").read_text().count("FILL_IN")
        print(f"--- try {attempt + 1} of {TRIES}\n{done.stdout}")
        if edits != 0:
            print(f"{edits} places of the imported robot file are left to fill in")
            return 1
        if "does not replay" in done.stdout:
            return 1
        if done.returncode == 0:
            return 0
    return 1


if __name__ == "__main__":
    sys.exit(main())
