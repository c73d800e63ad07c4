#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: whatever a policy server does, a whole robot under it follows no stale command and no answer to another question, is degraded and stopped within
what its robot file says, goes on where no harm is done, and can be set going again when the server is good. Method: the demo arm in real
processes by `takt run`, its policy a client of `takt.servers`, the server behind a wire of the test's own; in one run it is good, hostile
in one way, good again, and so on. The run's record is the judge: this test's clock and the machine's stalls decide nothing. Every answer says by its values which
question it is for.
Usage: hostile_servers_test.py SOURCE_DIR BIN_DIR openpi|groot [--only WORDS] [--folder DIR]
Exit codes: 0 fine, 1 not, 77 what it needs is not installed.
"""
import argparse
import importlib
import pathlib
import subprocess
import sys
import tempfile
import time

sys.dont_write_bytecode = True
TRIES = 3  # of a behaviour, where the machine's stalls stopped the robot instead
GOOD_ANSWERS = 25  # half a second of them, before and after
HARMLESS_ACTS = 25  # on one connection
PATIENCE_S = 30


def reached(holds):
    end = time.monotonic() + PATIENCE_S
    while not holds():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def is_stopped(status):
    return status.get("mode") in ("damped_stop", "fault_latched")


def tracks(robot, server):
    """Under the good server, for a while."""
    for _ in range(TRIES):
        before = len(server.answered)
        if robot.get_going() and reached(lambda: len(server.answered) >= before + GOOD_ANSWERS) and robot.status().get("mode") == "tracking":
            return True
    return False


class Try:
    """One behaviour, once. `cause` of the stop it ended in, if it did; times of the monotonic clock, ms."""

    def __init__(self, robot, server, behaviour):
        behaviour.before(server)
        self.tracked = tracks(robot, server)
        self.begin_ms = time.monotonic_ns() * 1e-6
        server.begin(behaviour)
        if behaviour.stops:
            self.came = robot.wait_until(is_stopped, PATIENCE_S)
        else:
            self.came = reached(lambda: max(server.acts.values(), default=0) >= HARMLESS_ACTS or is_stopped(robot.status()))
        self.end_ms = time.monotonic_ns() * 1e-6
        server.end()
        status = robot.status()
        self.cause = ""
        if is_stopped(status):
            self.cause = status["incident"]["cause"] if status["incident"]["monotonic_ns"] * 1e-6 > self.begin_ms else "a stop before"
        self.is_decided = self.cause == ("command_lost" if behaviour.stops else "")


def play(robot, server, behaviours):
    """Tries by behaviour, the last of each decides, as far as what was waited for came; and whether the robot tracks in the end."""
    tries = {}
    for name, behaviour in behaviours.items():
        tries[name] = []
        while len(tries[name]) < TRIES and not (tries[name] and tries[name][-1].is_decided):
            tries[name].append(Try(robot, server, behaviour))
            if not (tries[name][-1].tracked and tries[name][-1].came):
                return tries, False
    return tries, robot.get_going()


def judge(record, tries, behaviours, machine):
    wrong = []
    for name, each in tries.items():
        for one in each[:-1]:
            stop = record.stop_in(one.begin_ms, one.end_ms)
            print(f"{name}: tried again, the robot stopped by {stop.cause if stop else 'nothing'}")
            if stop and stop.cause not in (*machine, "command_lost"):
                wrong.append(f"{name}: stopped by {stop.cause}")
        one = each[-1]
        found = record.stop_in(one.begin_ms, one.end_ms)
        taken = record.taken_in(one.begin_ms, one.end_ms)
        if not one.tracked:
            wrong.append(f"{name}: the robot did not track by the good server before")
        elif not behaviours[name].stops:
            print(f"{name}: goes on, {taken} commands taken")
            if found or not one.came or taken < HARMLESS_ACTS // 2:
                wrong.append(f"{name}: {taken} commands were taken; stopped by {found.cause if found else 'nothing'}")
        elif found is None or found.cause != "command_lost":
            wrong.append(f"{name}: stopped by {found.cause if found else 'nothing'}, not by command_lost")
        else:
            print(f"{name}: {found.told}")
            wrong += [f"{name}: {what}" for what in found.wrong]
    return wrong


# Threat: policy-server
def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("programs", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("protocol", choices=("openpi", "groot"))
    parser.add_argument("--only", default="", help="behaviours whose names have these words")
    parser.add_argument("--folder", type=pathlib.Path)
    options = parser.parse_args()
    sys.path[:0] = [str(options.source / "client/python"), str(options.source / "tests/client")]
    try:
        import pandas  # noqa: F401
        import yaml  # noqa: F401
        import zstandard  # noqa: F401
        hostile = importlib.import_module(f"hostile_{options.protocol}")
    except ImportError as missing:
        print(f"SKIPPED: {missing}: NO ROBOT MET A HOSTILE SERVER")
        return 77
    import takt
    from served_robot import MACHINE, Record, ServedRobot
    behaviours = {name: behaviour for name, behaviour in hostile.BEHAVIOURS.items() if options.only in name}
    with tempfile.TemporaryDirectory(prefix="takt-hostile.") as made:
        folder = (options.folder or pathlib.Path(made)).resolve()
        folder.mkdir(parents=True, exist_ok=True)
        server = hostile.SERVER()
        robot = ServedRobot(options.source, options.programs, folder, server.url)
        try:
            tries, goes_on = play(robot, server, behaviours)
        finally:
            said = robot.finish()
            server.close()
        record = Record(takt.open(folder / "run"))
        wrong = judge(record, tries, behaviours, MACHINE) + record.never_stale() + record.commands_answer_their_observations(server.answered)
        if not goes_on:
            wrong.append("it did not track at the end of them all")
        for words in ([options.programs / "takt", "replay", folder / "run"], [options.programs / "judge_sent_frames", folder / "run"]):
            done = subprocess.run(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
            print(done.stdout.strip().splitlines()[-1] if done.stdout.strip() else f"{words[0].name} said nothing")
            if done.returncode != 0:
                wrong.append(f"{words[0].name}: {done.stdout[-2000:]}")
        if wrong:
            print(said[-3000:], robot.logs(), sep="\n")
    for each in wrong:
        print(f"WRONG: {each}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
