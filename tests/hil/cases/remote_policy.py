#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""remote_policy.py OUT: what a bad network did to a robot whose policy runs elsewhere, in what the case of that name left in OUT.

acts.txt says when each act began. Fails when a command was older than max_age, in a tick or on the bus; when delay and jitter kept the
robot from tracking, or its commands were not older by what the wire takes; when loss, repetition or disorder stopped it; when a cut was
noticed too early or too late, or did not end as it should.
"""
import json
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig.wire_age import MAX_AGE_MS, WRITE_MS, Run  # noqa: E402

ENOUGH = 10_000  # frames
WIRE_MS = (10, 30)  # both ways, of delay 10ms 5ms
PERIOD_MS = 20  # of observations: what comes out of order costs one
STOP_AFTER_MS = 600
SETTLED_NS = 200_000_000  # after an act's beginning only its own wire counts
NOTICED_MS = 50  # the contract's judgement; until the network is cut, and acts.txt's hundredths of a second
TICK_MS = 1.5


class Acts:
    def __init__(self, out, run):
        self.run = run
        lines = [line.split() for line in (out / "acts.txt").read_text().splitlines()]
        begins = [round(float(seconds) * 1e9) for _, seconds in lines]
        self.begin = {name: begin for (name, _), begin in zip(lines, begins)}
        self.end = {name: end for (name, _), end in zip(lines, [*begins[1:], run.now[-1]])}
        self.age_ms = (run.now - run.oldest) * 1e-6
        self.publish_ms = run.ticks["age_publish"] * 1e-6
        self.transitions = [json.loads(line) for line in (run.folder / "transitions.jsonl").read_text().splitlines()]

    def ticks(self, name):
        return (self.run.now >= self.begin[name] + SETTLED_NS) & (self.run.now < self.end[name])

    def playing(self, name):
        return self.ticks(name) & self.run.plays

    def summary(self, name):
        ticks, ages = self.ticks(name), self.age_ms[self.playing(name)]
        return (f"{name}: age p50 {np.median(ages):.1f}, p99 {np.percentile(ages, 99):.1f}, largest {ages.max():.1f} ms; of {np.count_nonzero(ticks)} "
                f"ticks {100 * np.mean(self.run.plays[ticks]):.1f} % play, {100 * np.mean(self.run.mode[ticks] == 'tracking'):.1f} % track")

    def changes(self, name):
        """(ms after the act's beginning, transition), in order."""
        at = {int(tick): now for tick, now in zip(self.run.ticks["tick"].tolist(), self.run.now.tolist())}
        return [((at[one["tick"]] - self.begin[name]) * 1e-6, one) for one in self.transitions
                if one["tick"] in at and self.begin[name] <= at[one["tick"]] < self.end[name]]


def problems(acts, frames_ms):
    run = acts.run
    if len(frames_ms) < ENOUGH:
        yield f"only {len(frames_ms)} frames with a command: too few to judge"
        return
    oldest_ms = acts.age_ms[run.plays].max()
    if oldest_ms > MAX_AGE_MS:
        yield f"a tick played a command {oldest_ms:.1f} ms old"
    if frames_ms.max() > MAX_AGE_MS + WRITE_MS:
        yield f"a frame carried a command {frames_ms.max():.1f} ms old"

    if not np.all(run.mode[acts.ticks("delayed")] == "tracking"):
        yield "delay and jitter kept the robot from tracking"
    youngest_ms = acts.publish_ms[acts.playing("delayed")].min()
    if youngest_ms < WIRE_MS[0]:
        yield f"a command crossed a wire of at least {WIRE_MS[0]} ms in {youngest_ms:.1f} ms"
    grown_ms = np.median(acts.age_ms[acts.playing("delayed")]) - np.median(acts.age_ms[acts.playing("good")])
    if not WIRE_MS[0] <= grown_ms <= WIRE_MS[1] + PERIOD_MS:
        yield f"the wire made commands {grown_ms:.1f} ms older, not {WIRE_MS[0]} to {WIRE_MS[1] + PERIOD_MS} ms"
    for name in ("lossy", "disordered"):
        if not np.isin(run.mode[acts.ticks(name)], ("tracking", "degraded")).all():
            yield f"{name}: the robot stopped"

    cut = acts.changes("cut")
    if [(one["from"], one["to"]) for _, one in cut] != [("tracking", "degraded"), ("degraded", "tracking")]:
        yield f"a cut of 0.4 s: {cut}"
    down = acts.changes("down")
    if [(one["to"], one["cause"]) for _, one in down] != [("degraded", "command_late"), ("damped_stop", "command_lost")]:
        yield f"the link down: {down}"
        return
    for (after_ms, one), what in ((cut[0], "a cut"), (down[0], "the link down")):
        if after_ms > MAX_AGE_MS + NOTICED_MS or not MAX_AGE_MS < one["age_ns"] * 1e-6 < MAX_AGE_MS + NOTICED_MS:
            yield f"degraded {after_ms:.1f} ms after {what}, at an age of {one['age_ns'] * 1e-6:.1f} ms"
    after_ms, one = down[1]
    if abs(one["age_ns"] * 1e-6 - MAX_AGE_MS - STOP_AFTER_MS) > TICK_MS or after_ms > MAX_AGE_MS + STOP_AFTER_MS + NOTICED_MS:
        yield f"stopped {after_ms:.1f} ms after the link went down, at an age of {one['age_ns'] * 1e-6:.1f} ms"


def main():
    out = pathlib.Path(sys.argv[1])
    run = Run(out)
    acts = Acts(out, run)
    frames_ms, _ = run.ages_on_wire(run.command_frames(out / "frames.log"))
    for name in ("good", "delayed", "lossy", "disordered"):
        print(acts.summary(name))
    publish = {name: np.median(acts.publish_ms[acts.playing(name)]) for name in ("good", "delayed")}
    print(f"between the policy's answer and the mailbox, both ways: p50 {publish['good']:.1f} ms, delayed {publish['delayed']:.1f} ms")
    for name in ("cut", "down"):
        for after_ms, one in acts.changes(name):
            print(f"{name}: {one['from']} to {one['to']} ({one['cause']}) after {after_ms:.0f} ms, at an age of {one['age_ns'] * 1e-6:.0f} ms")
    print(f"{len(frames_ms)} frames with a command at the peer: the oldest {frames_ms.max():.1f} ms (max_age {MAX_AGE_MS})")
    if found := list(problems(acts, frames_ms)):
        sys.exit("; ".join(found))


main()
