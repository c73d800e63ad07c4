#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: masses in a robot file that are not the robot's are said wherever a person looks, and true ones are not. Method: MuJoCo's seven-joint arm
under `takt run`, held by a Python policy, with the bodies that MuJoCo compiled as `model`, as they are and with half their masses: what `takt run`,
the monitor's log, `takt report` and metrics.json say. A half says that each joint carries 100 % more.
Usage: masses_test.py SOURCE_DIR BUILD_DIR
Exit codes: 0 fine, 1 not, 77 ../shared is not there (1 with TAKT_REQUIRE_SHARED=1).
"""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

FILES = ("no_model.yaml", "arm7.xml", "hold.py")


def told(build, folder, name, model, environment):
    robot = folder / f"{name}.yaml"
    text = (folder / "no_model.yaml").read_text().replace("timeout: 20 ms", "timeout: 200 ms")  # a machine that stalls now and then
    robot.write_text(text + "\n" + model)
    run = subprocess.run([build / "bin/takt", "run", robot, "--policy-host", folder / "hold.py", "--arm", "--duration", "3s", "--allow-non-realtime",
                          "--runtime-dir", folder / "sockets", "--run-dir", folder / name],
                         cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
    report = subprocess.run([build / "bin/takt", "report", folder / name], env=environment, capture_output=True, text=True, timeout=120)
    metrics = json.loads((folder / name / "metrics.json").read_text())
    return [run.stdout, (folder / name / "logs/takt-monitor.log").read_text(), report.stdout], metrics["load_mismatches"]


def main():
    source, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    field = source.parent / "shared/field"
    if not all((field / file).exists() for file in FILES):
        print(f"SKIPPED: {field} IS ABSENT: NO ARM WITH WRONG MASSES WAS HELD")
        return 1 if os.environ.get("TAKT_REQUIRE_SHARED") == "1" else 77
    environment = dict(os.environ, PYTHONPATH=str(source / "client/python"), PYTHONDONTWRITEBYTECODE="1", LD_LIBRARY_PATH=str(build / "lib"),
                       PATH="/usr/bin:/bin")  # Debian's Python has numpy
    with tempfile.TemporaryDirectory(prefix="takt-masses.") as made:
        folder = pathlib.Path(made)
        for file in FILES:
            shutil.copy(field / file, folder / file)
        subprocess.run([build / "bin/takt", "config", "new", folder / "arm7.xml", "--simulated", "-o", folder / "new.yaml"], check=True, capture_output=True)
        model = re.search(r"^model:.*\n(?:[ #].*\n|\n)*", (folder / "new.yaml").read_text(), re.M).group(0)
        halved = re.sub(r"mass: ([0-9.]+)", lambda mass: f"mass: {0.5 * float(mass[1]):.6g}", model)
        true, said_of_true = told(build, folder, "true", model, environment)
        half, said_of_half = told(build, folder, "half", halved, environment)
    if said_of_true or any("at rest, by `model`" in text for text in true):
        print("WRONG: true masses are said to be wrong:", *true, sep="\n")
        return 1
    shares = [each["measured"] / each["model"] for each in said_of_half]
    print("half the masses:", *(f"{each['joint']} {share:.2f}" for each, share in zip(said_of_half, shares)))
    if not shares or not all(1.9 < share < 2.1 for share in shares) or not all("at rest, by `model`" in text for text in half):
        print("WRONG: half the masses are not said, or not everywhere:", *half, sep="\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
