#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Lets a robot walk, from its published files or by its robot file: executive, plant, policy host and monitor as real processes by `takt run`.

First it walks as commanded, with the policy frozen for 300 ms on the way; then, in runs of their own, the policy is frozen for 2 s and
killed for good, and a person stops the robot, where its robot file leaves that to the fallback policy. What is printed comes from the plant's truth log (distance, height), the run's record (ages, misses with their causes)
and `takt replay`.

A robot without legs may walk on wheels. Exit codes: 0 it walked, stood at the end of the walk (with a fallback policy in its robot file: of every run, without moving, and by that policy where its own was
killed) and every run replays; 1 not; 64 command line, 65 a file is refused.
"""
import argparse
import json
import math
import pathlib
import re
import statistics
import subprocess
import sys
import tempfile
import time

LEAST_SHARE_WALKED = 0.5  # of what was commanded: policies track their command with an error of their own
HANGS_LOWEST = 0.4        # of the height at which it hung: below it, it fell as soon as it was released
STANDS = 0.75             # of the height at which it stood in the second after it was released
RESPONSE_S = 4            # after the walk, to come to a stand
STANDS_STILL_M = 0.15     # over ground at most in its last second


def command_of(robot_text, speed):
    """Values for the first axis of the robot file's velocity_command, within its limits; None: the policy takes no command."""
    limits = re.search(r"name: velocity_command.*?minimum: \[(.*?)\], maximum: \[(.*?)\], when_absent: \[(.*?)\]", robot_text, re.DOTALL)
    if limits is None:
        return None
    low, high, values = ([float(value) for value in group.split(",")] for group in limits.groups())
    values[0] = min(max(speed, low[0]), high[0])
    return values


class Walk:
    """One run: what happens to the policy, and what the robot did."""

    def __init__(self, options, robot, name, seconds, events):
        self.options, self.robot, self.seconds, self.events = options, robot, seconds, events
        self.folder = options.folder / name
        self.truth_file = options.folder / f"{name}.truth.jsonl"
        self.began_ns = self.ended_ns = 0

    def takt(self, *words, **more):
        return subprocess.run([self.options.programs / "takt", *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **more)

    def run(self, command):
        with tempfile.TemporaryDirectory() as sockets:
            words = [self.options.programs / "takt", "run", self.robot, "--arm", "--to-the-end", "--duration", f"{self.seconds + RESPONSE_S}s",
                     "--allow-non-realtime", "--runtime-dir", sockets, "--run-dir", self.folder, f"--plant=--truth={self.truth_file}"]
            for event in self.events:
                words += ["--at", event]
            with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as run:
                self.said = ""
                for line in run.stdout:
                    self.said += line
                    if re.search(r"s  tracking ", line) and not self.began_ns:
                        self.began_ns = time.monotonic_ns()
                        self.ended_ns = self.began_ns + int(self.seconds * 1e9)
                        if command:
                            person = subprocess.Popen([self.options.programs / "takt", "command", "velocity_command", *map(str, command), "--for",
                                                       f"{self.seconds}s", "--robot", self.robot, "--runtime-dir", sockets])
                run.wait()
                if self.began_ns and command:
                    person.terminate()
                    person.wait()
        return bool(self.began_ns)

    def judge(self):
        """Path of the base over ground while walking was commanded, and its heights."""
        with open(self.truth_file) as lines:
            truth = [(line["monotonic_ns"], line["tool"]) for line in map(json.loads, lines)]
        walking = [at for when, at in truth if self.began_ns <= when <= self.ended_ns]
        first, last = walking[0], walking[-1]
        self.distance_m = math.hypot(last[0] - first[0], last[1] - first[1])
        hung = truth[0][1][2]
        until_ns = self.began_ns + int((self.seconds + RESPONSE_S) * 1e9)  # what follows is the end of its programs
        live = [(when, at) for when, at in truth if self.began_ns <= when <= until_ns]
        stood = statistics.median(at[2] for when, at in live if when <= self.began_ns + 1e9)
        self.height_begin_m, self.height_m = stood, last[2]
        fallen = [when for when, at in live if at[2] < (STANDS * stood if stood > HANGS_LOWEST * hung else hung)]
        self.fell_after_s = (fallen[0] - self.began_ns) / 1e9 if fallen else None
        still = [at for when, at in live if when >= live[-1][0] - 1e9]
        self.moved_m = max(math.hypot(at[0] - still[0][0], at[1] - still[0][1]) for at in still)
        self.final_mode = re.findall(r"^ *[\d.]+ s  (\S+) +age", self.said, re.MULTILINE)[-1]
        replay = self.takt("replay", self.folder)
        self.replayed = replay.returncode == 0
        self.replay_said = replay.stdout.strip().splitlines()[-1] if replay.stdout.strip() else "nothing was said"

    def tell(self, what):
        stands = "stands" if self.fell_after_s is None else f"fell {self.fell_after_s:.1f} s after it began to track"
        print(f"\n{what}\n  walked {self.distance_m:.2f} m in {self.seconds:.0f} s, base then at {self.height_m:.2f} m (stood at "
              f"{self.height_begin_m:.2f} m): {stands}; at the end {self.final_mode}, {self.moved_m:.2f} m in the last second")
        for line in report_lines(self.takt("report", self.folder).stdout):
            print(f"  {line}")
        incident = [line for line in self.said.splitlines() if re.match(r"(stop|fault) at tick", line)]
        if incident:
            print(f"  {incident[-1]}")
        print(f"  replay: {self.replay_said}")


def report_lines(report):
    """Ages of the ticks that relied on the policy, misses and late ticks, as `takt report` has them."""
    age = re.search(r"age per tick.*?\n *(p50.*?)\n.*?\n *total +(.*?)\n", report, re.DOTALL)
    lines = [f"age {' / '.join(age[1].split())}: {' / '.join(age[2].split())} ms"] if age else []
    return lines + [" ".join(line.split()) for line in report.splitlines() if re.match(r" *(contract|per tick|per command|overruns) ", line)]


def main():
    parse = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parse.add_argument("--model", type=pathlib.Path, help="MJCF file")
    parse.add_argument("--policy", type=pathlib.Path, help="ONNX file")
    parse.add_argument("--deploy", type=pathlib.Path, help="deploy.yaml")
    parse.add_argument("--robot", type=pathlib.Path, help="robot file with simulation.mujoco, instead of those three")
    parse.add_argument("--programs", required=True, type=pathlib.Path, help="folder of Takt's programs")
    parse.add_argument("--folder", required=True, type=pathlib.Path, help="folder to make, for the robot file and the runs")
    parse.add_argument("--speed", type=float, default=0.5, help="m/s ahead")
    parse.add_argument("--seconds", type=float, default=30, help="of walking")
    options = parse.parse_args()
    options.programs, options.folder = options.programs.resolve(), options.folder.resolve()
    published = (options.model, options.policy, options.deploy)
    if (options.robot is None) != (None not in published) or (options.robot and any(published)):
        parse.error("give --model, --policy and --deploy, or --robot alone")
    options.folder.mkdir(parents=True)
    robot = options.robot.resolve() if options.robot else options.folder / "robot.yaml"
    steps = [["config", "check", robot]]
    if not options.robot:
        steps.insert(0, ["config", "import", options.deploy.resolve(), "--policy", options.policy.resolve(), "--model", options.model.resolve(),
                         "--simulated", "--robot", "walker", "-o", robot])
    for words in steps:
        done = subprocess.run([options.programs / "takt", *words])
        if done.returncode != 0:
            return done.returncode
    command = command_of(robot.read_text(), options.speed)
    saved = "kind: policy" in robot.read_text()  # a fallback that knows how to stand; without one, losing the policy is a fall
    # Name, what happens, how long it is told to walk, what is done to it, the mode that it has to end in.
    acts = [("walk", "walks; the policy is frozen for 300 ms on the way", options.seconds, [f"{options.seconds * 0.6:.0f}s: freeze policy 300ms"], "tracking"),
            ("frozen", "the policy is frozen for 2 s", 8, ["4s: freeze policy 2s"], "tracking"),
            ("killed", "the policy is killed for good", 8, ["4s: kill policy"], "fallback")]
    if "operator_stop: { how: policy" in robot.read_text():
        acts.append(("stopped", "a person stops it", 8, ["4s: stop"], "stop/fallback"))
    wrong = []
    for name, what, seconds, events, ends_in in acts:
        walk = Walk(options, robot, name, seconds, events)
        if not walk.run(command):
            print(walk.said, file=sys.stderr)
            return 1
        walk.judge()
        walk.tell(what)
        if not walk.replayed:
            wrong.append(f"{name}: does not replay")
        if walk.fell_after_s is not None and (name == "walk" or saved):
            wrong.append(f"{name}: it fell")
        if (name == "walk" or saved) and walk.final_mode != ends_in:
            wrong.append(f"{name}: it ended in {walk.final_mode}, not {ends_in}")
        if saved and command and walk.moved_m > STANDS_STILL_M:
            wrong.append(f"{name}: it went {walk.moved_m:.2f} m in its last second, when nothing was commanded any more")
        if name == "walk" and command and walk.distance_m < LEAST_SHARE_WALKED * abs(command[0]) * seconds:
            wrong.append(f"walk: {walk.distance_m:.2f} m is less than half of what was commanded")
    print("\n" + ("\n".join(wrong) if wrong else "it walked"))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
