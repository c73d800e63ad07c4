#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: two operators arm one robot, and neither harms it: who comes second finds it armed. Method: `takt run --arm` stands still (SIGSTOP) once it
has started its last process; meanwhile `takt arm` arms the robot; then `takt run` goes on. And a person's stop stays under --rearm-after: the robot
is watched for longer than that waits, then that person arms it; also where the robot had stopped itself before. And what the other says of a mark is in the run.
Usage: armed_by_another_test.py SOURCE_DIR BIN_DIR
"""
import json
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


def a_persons_stop_stays(programs, file, folder, *, in_its_own):
    """Empty: it does. `in_its_own`: the person stops a robot that has stopped itself, of a policy that comes back before it would be armed again."""
    robot = Operated(programs, folder / f"again-{in_its_own}")
    after_ms, trouble = (2500, ["--at", "1s: freeze policy 1500ms"]) if in_its_own else (200, [])
    run = robot.start(file, folder / f"rearmed-{in_its_own}", "--rearm-after", f"{after_ms}ms", "--to-the-end", *trouble, duration="60s")
    tracks = robot.wait_until(lambda status: status.get("mode") == "tracking")
    if in_its_own:
        tracks = tracks and robot.wait_until(lambda status: status.get("mode") == "damped_stop")
    robot.ask("stop")
    stopped = robot.wait_until(lambda status: status.get("mode") == "damped_stop")
    watched_until = time.monotonic() + max(2, 2 * after_ms / 1000)
    modes = set()
    while time.monotonic() < watched_until:
        modes.add(robot.status().get("mode"))
    back = robot.wait_until(lambda _: robot.ask("reset").returncode == 0) and robot.wait_until(lambda _: robot.ask("arm").returncode == 0)
    run.terminate()
    said = run.communicate(timeout=60)[0]
    return "" if tracks and stopped and modes == {"damped_stop"} and back else f"{said}\nWRONG: tracked {tracks}, stopped {stopped}, then {modes}, armed again {back}"


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
        answers = []

        def arms(_):
            answers.append(robot.ask("arm"))
            return answers[-1].returncode == 0 or "already armed" in answers[-1].stdout  # `takt run` was first: then this is who comes second

        if not robot.wait_until(arms):
            print(f"WRONG: not armed by another: {answers[-1].stdout}", *(log.read_text() for log in (folder / "sockets/logs").glob("*")), sep="\n")
            os.kill(run.pid, signal.SIGCONT)
            run.communicate(timeout=60)
            return 1
        os.kill(run.pid, signal.SIGCONT)
        marked = robot.takt("mark", "the", "gripper slips", "--runtime-dir", folder / "sockets")
        said = run.communicate(timeout=60)[0]
        marks = json.loads((folder / "run/metrics.json").read_text())["marks"]
        if marked.returncode != 0 or [mark.get("text") for mark in marks] != ["the gripper slips"]:
            print(f"WRONG: {marked.stdout} of a mark with text, and metrics.json has {marks}")
            return 1
        if run.returncode != 0 or "refused" in said:
            print(said, f"WRONG: armed by another, takt run ended with {run.returncode}", sep="\n")
            return 1
        for in_its_own in (False, True):
            if wrong := a_persons_stop_stays(programs, file, folder, in_its_own=in_its_own):
                print(f"in its own stop: {in_its_own}", wrong)
                return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
