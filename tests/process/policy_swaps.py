#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: policies are swapped on a live robot under load, and hosts killed at random instants of it, without a missed period that the swap caused,
a setpoint beyond the limits or a tick that says the wrong policy; and every tick replays. Method: the demo arm by `takt run`, its own network
under another hash as the candidate, a busy process on every core; `takt policy swap` and `back` as people call them. The run's record is
judged: periods missed within 20 ms of a handover against all others, with their causes; steps of the references against the limits;
`command_policy` of every tick against the message that was taken.
Usage: policy_swaps.py SOURCE_DIR BIN_DIR [--swaps N] [--seed N] [--folder DIR]
Exit codes: 0 fine, 1 not, 77 no numpy or pandas.
"""
import argparse
import os
import pathlib
import random
import re
import subprocess
import sys
import tempfile
import time

from operated import Operated
from patient import patient

NEAR_TICKS = 20
PROBATION = "400 ms"
OWN_WORK = ("own_overrun", "blocked", "page_fault")  # causes that are the executive's own
MACHINE = ("feedback_lost", "overrun", "operator_stop", "shutdown", "replies_delayed")  # stops that a stalled machine, or a person, explains


def robot_and_candidate(source, folder):
    """The demo arm with a short probation, and its network as another file: a doc_string (field 6 of ONNX's ModelProto) behind it."""
    own = source / "config/arm6_reach.onnx"
    text = patient((source / "config/arm6.yaml").read_text()).replace("file: arm6_reach.onnx", f"file: {own}\n  probation: {PROBATION}")
    robot = folder / "arm6.yaml"
    robot.write_text(text)
    candidate = folder / "retrained.onnx"
    candidate.write_bytes(own.read_bytes() + b"\x32\x09retrained")
    return robot, candidate


class Storm(Operated):
    def __init__(self, options, folder):
        super().__init__(options.programs, folder / "sockets")
        self.options = options
        self.random = random.Random(options.seed)
        self.robot, self.candidate = robot_and_candidate(options.source, folder)
        self.run_folder = folder / "run"
        self.host = None
        self.counts = {"swaps": 0, "kills": 0, "refused": 0, "stops": 0}

    def keep_candidate(self):
        if self.host is not None and self.host.poll() is None:
            return
        words = [self.options.programs / "takt-policy-host", "--robot", self.robot, "--runtime-dir", self.sockets, "--candidate", self.candidate]
        self.host = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.wait_until(lambda status: (status.get("candidate") or {}).get("freshness") == "fresh" and status["candidate_pid"] == self.host.pid)

    def one_swap(self):
        self.keep_candidate()
        kills = self.random.random() < 0.4
        asked = subprocess.Popen([self.options.programs / "takt", "policy", "swap", "--runtime-dir", self.sockets],
                                 stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        if kills:
            time.sleep(self.random.uniform(0, 0.3))
            self.host.kill()
            self.host.wait()
            self.counts["kills"] += 1
        self.counts["refused"] += asked.wait(30) != 0
        if not kills and self.random.random() < 0.5:
            self.wait_until(lambda status: not status["candidate"]["on_probation"])
        if self.status()["candidate"]["in_charge"]:
            self.takt("policy", "back", "--runtime-dir", self.sockets)
        if not self.wait_until(lambda status: not status["candidate"]["in_charge"] and status["mode"] == "tracking", 5):
            self.get_going()

    def get_going(self):
        """A machine that stalls stops the robot; why is judged by the record."""
        self.counts["stops"] += 1
        return super().get_going()

    def run(self):
        busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"], preexec_fn=lambda: os.nice(19)) for _ in range(os.cpu_count())]
        run = self.start(self.robot, self.run_folder)
        try:
            self.wait_until(lambda status: status.get("mode") == "tracking", 60)
            for _ in range(self.options.swaps):
                if run.poll() is not None:
                    break
                self.one_swap()
                self.counts["swaps"] += 1
        finally:
            for process in busy + ([self.host] if self.host else []):
                process.kill()
                process.wait()
            if run.poll() is None:
                run.send_signal(2)
            self.said = run.communicate()[0]
        return self.counts["swaps"] == self.options.swaps


def limits_of(resolved):
    """Joint -> velocity, acceleration, of a run's resolved robot file: `3 rad/s`."""
    import yaml
    limits = {joint["name"]: joint["limits"] for joint in yaml.safe_load(resolved.read_text())["joints"]}
    return {name: [float(str(each[key]).split()[0]) for key in ("velocity", "acceleration")] for name, each in limits.items()}


def judge(takt, storm):
    """What the record says; the list of what is wrong with it."""
    import numpy as np
    run = takt.open(str(storm.run_folder))
    ticks, commands = run.ticks, run.commands
    wrong = []
    change = ticks["policy_change"].astype(str)
    handover = change.isin(["swapped", "back", "back_for_age", "back_for_refusals", "back_for_range", "back_for_stop"]).to_numpy()
    late = (ticks["overrun_cause"].astype(str) != "none").to_numpy()
    near = np.convolve(handover, np.ones(NEAR_TICKS), "full")[:len(handover)] > 0
    causes = ticks["overrun_cause"].astype(str)
    print(f"ticks {len(ticks)}, handovers {handover.sum()}: " + ", ".join(f"{name} {count}" for name, count in change[change != "none"].value_counts().items()))
    for name, where in (("within 20 ms of a handover", near), ("elsewhere", ~near)):
        found = causes[where & late].value_counts()
        print(f"missed periods {name}: {(late & where).sum()} of {where.sum()} ticks = {1e6 * (late & where).sum() / max(where.sum(), 1):.0f} per million"
              + "".join(f"; {cause} {count}" for cause, count in found.items()))
    work = ticks["last_duration"].to_numpy()[1:] * 1e-3  # of the tick before
    for name, where in (("handover", handover[:-1]), ("other", ~handover[:-1])):
        if where.any():
            print(f"work of a tick, {name}: p50 {np.percentile(work[where], 50):.1f} us, p99 {np.percentile(work[where], 99):.1f} us")
    # A machine that stalls inside a tick makes that tick look long, wherever it is: more than chance has it is the swap's.
    own, elsewhere = (causes[where & late].isin(OWN_WORK).sum() for where in (near, ~near))
    by_chance = elsewhere / max((~near).sum(), 1) * near.sum()
    print(f"missed by the executive's own work within 20 ms of a handover: {own}; as elsewhere it would be {by_chance:.2f}")
    if own > by_chance + 3 * max(by_chance, 1 / 3) ** 0.5:
        wrong.append(f"{own} periods missed by the executive's own work within 20 ms of a handover")
    step = np.diff(ticks["tick"].to_numpy())
    for joint, (velocity, acceleration) in limits_of(storm.run_folder / "config.yaml").items():
        speed = ticks[f"dq_reference.{joint}"].to_numpy().astype(float)
        jump = np.abs(np.diff(speed)) / 1e-3
        moved = np.abs(np.diff(ticks[f"q_reference.{joint}"].to_numpy().astype(float))) / 1e-3
        whole = (step == 1) & (ticks["mode"].astype(str).to_numpy()[1:] == "tracking") & (ticks["mode"].astype(str).to_numpy()[:-1] == "tracking")
        if (np.abs(speed) > velocity * 1.0001).any() or (moved[whole] > velocity * 1.01 + 1e-3).any():
            wrong.append(f"{joint}: a setpoint beyond the velocity limit")
        if (jump[whole] > acceleration * 1.02 + 0.02).any():
            wrong.append(f"{joint}: a velocity step beyond the acceleration limit: {jump[whole].max():.2f} of {acceleration} rad/s^2")
    # Which message the command in use is, by hash, sequence and observation: claims of the messages themselves.
    said = set(zip(commands["policy_hash"], commands["sequence"], commands["observation_id"]))
    in_use = set(zip(ticks["command_policy"], ticks["command_sequence"], ticks["observation_answered"])) - {(0, 0, 0)}
    if not in_use <= said:
        wrong.append(f"{len(in_use - said)} commands in use are nobody's message")
    charge = ticks["candidate_in_charge"].to_numpy().astype(bool)
    candidate = ticks["candidate_policy_hash"].to_numpy()
    is_candidates = (ticks["command_policy"].to_numpy() == candidate) & (candidate != 0)
    # In charge and in use differ only from a way back without a fresh command of the robot's own, until one comes.
    fresh = ticks["freshness"].astype(str).isin(["fresh", "aging"]).to_numpy()
    if ((charge != is_candidates) & fresh).any():
        wrong.append(f"{((charge != is_candidates) & fresh).sum()} ticks follow a policy that is not in charge")
    modes = ticks["mode"].astype(str)
    tracking = np.flatnonzero(modes == "tracking")
    armed = modes.to_numpy()[tracking[0]:tracking[-1] + 1] if len(tracking) else modes
    print(f"tracking {100 * (armed == 'tracking').mean():.3f} % of the ticks between the first arming and the end")
    entered = ticks[(modes != ticks["previous_mode"].astype(str)) & modes.isin(["damped_stop", "fault_latched"])]
    for _, stop in entered.iterrows():
        what = f"stopped at tick {stop['tick']}: {stop['cause']}"
        print(what)
        if str(stop["cause"]) not in MACHINE:
            wrong.append(what)
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("programs", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("--swaps", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=pathlib.Path)
    options = parser.parse_args()
    sys.path.insert(0, str(options.source / "client/python"))
    try:
        import pandas  # noqa: F401
        import yaml  # noqa: F401
    except ImportError as missing:
        print(f"SKIPPED: {missing}: NO POLICY WAS SWAPPED")
        return 77
    import takt
    with tempfile.TemporaryDirectory() as made:
        folder = options.folder or pathlib.Path(made)
        folder.mkdir(parents=True, exist_ok=True)
        storm = Storm(options, folder)
        whole = storm.run()
        print(", ".join(f"{name} {count}" for name, count in storm.counts.items()))
        if not whole:
            print(storm.said[-3000:])
            return 1
        wrong = judge(takt, storm)
        replay = storm.takt("replay", storm.run_folder)
        print(replay.stdout.strip().splitlines()[-1] if replay.stdout else "takt replay said nothing")
        if replay.returncode != 0 or not re.search(r"\d", replay.stdout):
            wrong.append("the run does not replay")
    for each in wrong:
        print(f"WRONG: {each}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
