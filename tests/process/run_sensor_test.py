#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: `takt run --sensor NAME=PROGRAM` starts what serves a sensor before the policy needs it, keeps its log, and loses no robot when it dies.
Method: the page's camera and policy under the real processes: a run, a camera killed with and without --restart, and every refusal: a sensor
that the robot lacks, no program, a program that is not there or ends at once, two of one sensor.
Usage: run_sensor_test.py SOURCE_DIR BUILD_DIR
"""
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile
import threading

IMAGE = "\n  - { name: cam0, image: { height: 48, width: 64, channels: 1 }, timeout: 400 ms }"


def robot_text(source):
    text = (source / "config/arm6.yaml").read_text().replace("file: arm6_reach.onnx", "file: look.py")
    text = text.replace("\n  observation:", "\n  observation:\n    - { term: sensor, sensor: cam0 }", 1)
    return text.replace("\nsensors:", "\nsensors:" + IMAGE, 1)


class Bench:
    def __init__(self, source, build, folder):
        self.folder, self.takt = folder, build / "bin/takt"
        shutil.copytree(source / "config", folder / "config", ignore=shutil.ignore_patterns("*.cpp", "*.hpp"))
        shutil.copy(source / "docs/examples/python-sensor/camera.py", folder)
        look = (source / "docs/examples/python-sensor/look.py").read_text()
        assert 'max_age="100 ms"' in look
        (folder / "look.py").write_text(look.replace('max_age="100 ms"', 'max_age="400 ms"'))  # a machine that stalls now and then
        (folder / "look.py").chmod(0o755)
        (folder / "robot.yaml").write_text(robot_text(source).replace("max_age: 150 ms", "max_age: 400 ms"))
        # Debian's Python has numpy
        self.environment = dict(os.environ, PYTHONPATH=str(source / "client/python"), LD_LIBRARY_PATH=str(build / "lib"), PATH="/usr/bin:/bin")

    def run(self, *words, kill_camera=False):
        """Its exit code, its text and its events; the camera is killed at the first word about tracking."""
        command = [self.takt, "run", "robot.yaml", "--runtime-dir", "rt", "--policy-host", "./look.py", "--arm", "--allow-non-realtime", "--run-dir", "run", *words]
        shutil.rmtree(self.folder / "run", ignore_errors=True)
        run = subprocess.Popen(command, cwd=self.folder, env=self.environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        guard = threading.Timer(90, run.kill)
        guard.start()
        text = ""
        while character := run.stdout.read(1):
            text += character
            if kill_camera and text.endswith("tracking"):
                kill_camera = False
                os.kill(next(event["pid"] for event in self.events() if event["event"] == "started" and event["process"] == "sensor-cam0"), signal.SIGKILL)
        run.wait()
        guard.cancel()
        return run.returncode, text, self.events() if (self.folder / "run/events.jsonl").exists() else []

    def events(self):
        return [json.loads(line) for line in (self.folder / "run/events.jsonl").read_text().splitlines()]


def of_sensor(events):
    return [event["event"] for event in events if event.get("process") == "sensor-cam0"]


def wrong(bench):
    code, text, events = bench.run("--duration", "1s", "--sensor", "cam0=./camera.py")
    if code != 0 or of_sensor(events) != ["started", "ended"] or not (bench.folder / "run/logs/sensor-cam0.log").exists():
        return f"the camera's run ended with {code}: {of_sensor(events)}\n{text}"
    code, text, events = bench.run("--duration", "4s", "--sensor", "cam0=./camera.py", kill_camera=True)
    if code != 2 or "sensor-cam0 was killed by SIGKILL" not in text or "command_lost" not in text or of_sensor(events) != ["started", "ended"]:
        return f"a killed camera's run ended with {code}: {of_sensor(events)}\n{text}"
    code, text, events = bench.run("--duration", "4s", "--sensor", "cam0=/usr/bin/python3 camera.py", "--restart", "--rearm-after", "500ms", kill_camera=True)
    if code != 0 or "sensor-cam0 restarted" not in text or of_sensor(events) != ["started", "ended", "started", "ended"]:
        return f"a restarted camera's run ended with {code}: {of_sensor(events)}\n{text}"
    (bench.folder / "dies.sh").write_text("#!/bin/sh\n[ -e served ] && exit 1\ntouch served\nexec timeout 2 ./camera.py \"$@\"\n")
    (bench.folder / "dies.sh").chmod(0o755)
    code, text, events = bench.run("--duration", "5s", "--to-the-end", "--restart", "--sensor", "cam0=./dies.sh")
    starts = [event["monotonic_ns"] for event in events if event.get("process") == "sensor-cam0" and event["event"] == "started"]
    if len(starts) < 3 or len(starts) > 2 + (starts[-1] - starts[0]) / 1e9:
        return f"a camera that dies at once was started {len(starts)} times in {(starts[-1] - starts[0]) / 1e9:.1f} s\n{text[-2000:]}"
    (bench.folder / "wrapped.sh").write_text("#!/bin/sh\n./camera.py \"$@\" &\necho $! >camera.pid\nwait\n")
    (bench.folder / "wrapped.sh").chmod(0o755)
    code, text, events = bench.run("--duration", "1s", "--sensor", "cam0=./wrapped.sh")
    if code != 0 or pathlib.Path("/proc", (bench.folder / "camera.pid").read_text().strip()).exists():
        return f"what a script of a sensor started outlives the run, which ended with {code}\n{text}"
    for expected, sentence, words in (
            (64, "has no sensor cam1; it has: cam0", ["cam1=./camera.py"]),
            (64, "write NAME=PROGRAM", ["cam0"]),
            (64, "write NAME=PROGRAM", ["cam0= "]),
            (64, "a second program of cam0", ["cam0=./camera.py", "cam0=./camera.py"]),
            (69, "./none.py: not found", ["cam0=./none.py"]),
            (1, "exited with 0 before it served the sensor", ["cam0=true"])):
        code, text, _ = bench.run("--duration", "1s", *[word for text in words for word in ("--sensor", text)])
        if code != expected or sentence not in text:
            return f"--sensor {words} ended with {code} instead of {expected}:\n{text}"
    return ""


def main():
    source, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    with tempfile.TemporaryDirectory(prefix="takt-sensor.") as made:
        problem = wrong(Bench(source, build, pathlib.Path(made)))
    print(problem or "the camera came, died and came back")
    return 1 if problem else 0


if __name__ == "__main__":
    sys.exit(main())
