#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: two operators arm one robot, and neither harms it: who comes second finds it armed. Method: `takt run --arm` stands still (SIGSTOP) once it
has started its last process; meanwhile `takt arm` arms the robot; then `takt run` goes on.
Usage: armed_by_another_test.py SOURCE_DIR BIN_DIR
"""
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import time

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parent)]
from operated import Operated  # noqa: E402
from patient import patient  # noqa: E402


def has_child(run, program, deadline):
    while time.monotonic() < deadline and run.poll() is None:
        children = subprocess.run(["ps", "--ppid", str(run.pid), "-o", "args="], stdout=subprocess.PIPE, text=True, check=False).stdout
        if program in children:
            return True
    return False


def main():
    source, programs = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    with tempfile.TemporaryDirectory(prefix="takt-armed.") as made:
        folder = pathlib.Path(made)
        shutil.copytree(source / "config", folder / "config")
        file = folder / "config/arm6.yaml"
        file.write_text(patient(file.read_text()))
        robot = Operated(programs, folder / "sockets")
        run = robot.start(file, folder / "run", duration="4s")
        if not has_child(run, "takt-policy-host", time.monotonic() + 20):
            print(run.communicate()[0], "WRONG: no policy host was started", sep="\n")
            return 1
        os.kill(run.pid, signal.SIGSTOP)
        armed = robot.wait_until(lambda _: robot.ask("arm").returncode == 0)
        os.kill(run.pid, signal.SIGCONT)
        said = run.communicate(timeout=60)[0]
        if not armed or run.returncode != 0 or "refused" in said:
            print(said, f"WRONG: armed by another {armed}, takt run ended with {run.returncode}", sep="\n")
            return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
