#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a robot file without `model` does not let its arm fall when a person stops it. Method: a seven-joint arm of MuJoCo's under `takt run`, held
by a Python policy and stopped; what each joint did afterwards is read in the plant's truth log. A joint that holds by stiffness sags by its load
over its stiffness, and no further.
Usage: stop_without_model_test.py SOURCE_DIR BUILD_DIR
Exit codes: 0 fine, 1 not, 77 ../shared is not there (1 with TAKT_REQUIRE_SHARED=1).
"""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

FILES = ("no_model.yaml", "arm7.xml", "hold.py")
STOP_S, END_S = 4, 9
SAG_RAD = 0.3  # 4 Nm, all that a joint has, over a stiffness of 30 Nm/rad are 0.13


def main():
    source, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    field = source.parent / "shared/field"
    if not all((field / file).exists() for file in FILES):
        print(f"SKIPPED: {field} IS ABSENT: NO ARM WITHOUT A MODEL WAS STOPPED")
        return 1 if os.environ.get("TAKT_REQUIRE_SHARED") == "1" else 77
    sys.dont_write_bytecode = True
    with tempfile.TemporaryDirectory(prefix="takt-no-model.") as made:
        folder = pathlib.Path(made)
        for file in FILES:
            shutil.copy(field / file, folder / file)
        robot = folder / "no_model.yaml"
        robot.chmod(0o644)
        robot.write_text(robot.read_text().replace("timeout: 20 ms", "timeout: 200 ms"))  # a machine that stalls now and then
        environment = dict(os.environ, PYTHONPATH=str(source / "client/python"), LD_LIBRARY_PATH=str(build / "lib"), PATH="/usr/bin:/bin")  # Debian's Python has numpy
        run = subprocess.run([build / "bin/takt", "run", robot, "--policy-host", folder / "hold.py", "--arm", "--duration", f"{END_S}s", "--at",
                              f"{STOP_S}s: stop", "--to-the-end", "--allow-non-realtime", "--runtime-dir", folder / "sockets", "--run-dir",
                              folder / "run", f"--plant=--truth={folder / 'truth.jsonl'}"],
                             cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
        transitions = [json.loads(line) for line in (folder / "run/transitions.jsonl").read_text().splitlines()]
        stops = [each for each in transitions if each["to"] == "damped_stop"]
        truth = [json.loads(line) for line in (folder / "truth.jsonl").read_text().splitlines()]
    if not stops or stops[0]["cause"] != "operator_stop":
        print(run.stdout[-4000:], f"WRONG: the stop was not reached, or by {stops}", sep="\n")
        return 1
    stopped_ns = stops[0]["monotonic_ns"]
    before = [each["q"] for each in truth if each["monotonic_ns"] <= stopped_ns][-1]
    after = [each["q"] for each in truth if each["monotonic_ns"] > stopped_ns]
    moved = [max(abs(q[joint] - before[joint]) for q in after) for joint in range(len(before))]
    print("moved after the stop, rad:", " ".join(f"{each:.3f}" for each in moved), f"in {len(after)} lines")
    if max(moved) > SAG_RAD or "falls" not in run.stdout and "brakes" not in run.stdout:
        print(run.stdout[-4000:], f"WRONG: a joint moved by {max(moved):.2f} rad, or nothing says what a stop does", sep="\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
