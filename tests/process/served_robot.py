# SPDX-License-Identifier: Apache-2.0
"""The demo arm under a policy that asks a server, and what its record must say, whatever the server does."""
import collections
import os
from typing import List, NamedTuple

import numpy as np
from operated import Operated
from patient import patient

CHANGES = (("max_age: 150 ms", "max_age: 300 ms"), ("stop_after: 600 ms", "stop_after: 900 ms"), ("target, values: 3, timeout: 200 ms", "target, values: 3, timeout: 500 ms"),
           ("file: arm6_reach.onnx", "file: served_policy.py"), ("  steps: 16", "  steps: 32"))
STEPS, SWAYS, SAYS = 32, 0, 3  # joints: one that moves, and one whose target is the observation's number
ONE = 2.0 ** -14  # rad; exact in float32, and five minutes of observations turn the wrist by 1 rad
MACHINE = ("feedback_lost", "overrun", "replies_lost", "replies_delayed", "recording_lost", "drive_disabled", "enable_timeout")  # a stalled machine explains these stops
NEVER = ("wrong_shape", "not_finite", "out_of_range", "unknown_observation", "future_observation", "repeated_sequence", "wrong_policy", "missing_stamp")


def actions(observation):
    """(steps, joints): what a server that behaves answers. The answer itself says which question it is for."""
    number = observation["n"]
    q = np.tile(np.asarray(observation["home"], np.float32), (STEPS, 1))
    q[:, SWAYS] += 0.2 * np.sin(number / 40)
    q[:, SAYS] = number * ONE
    return q


class ServedRobot(Operated):
    """`takt run` in `folder`, with served_policy.py as its policy."""

    def __init__(self, source, programs, folder, url):
        super().__init__(programs, folder / "sockets")
        self.folder = folder
        text = patient((source / "config/arm6.yaml").read_text())
        for usual, ours in CHANGES:
            if text.count(usual) != 1:
                raise ValueError(f"`{usual}` stands {text.count(usual)} times in the robot file, not once")
            text = text.replace(usual, ours)
        self.robot = folder / "robot.yaml"
        self.robot.write_text(text)
        policy = folder / "served_policy.py"
        policy.write_bytes((source / "tests/process/served_policy.py").read_bytes())
        policy.chmod(0o755)
        library = programs.parent / "lib"
        environment = {**os.environ, "PYTHONPATH": str(source / "client/python"), "LD_LIBRARY_PATH": str(library), "PYTHONDONTWRITEBYTECODE": "1",
                       "TAKT_TEST_SERVER": url}
        self.process = self.start(self.robot, folder / "run", "--policy-host", "./served_policy.py", "--policy-may", "network", duration="290s", cwd=folder, env=environment)

    def finish(self):
        """What it said, once the run folder is complete."""
        if self.process.poll() is None:
            self.process.send_signal(2)
        return self.process.communicate(timeout=60)[0]

    def logs(self):
        return "".join(f"--- {path.name}\n{path.read_text()[-4000:]}" for path in sorted((self.folder / "run/logs").glob("*.log")))


def milliseconds(text):
    number, unit = text.split()
    return float(number) * {"ms": 1, "s": 1000}[unit]


class Stop(NamedTuple):
    cause: str
    told: str = ""
    wrong: List[str] = []


class Record:
    """The run's ticks, and the robot file's word about them."""

    def __init__(self, run):
        import yaml
        contract = yaml.safe_load((run.folder / "config.yaml").read_text())["freshness"]
        self.max_age_ms, self.stop_after_ms = milliseconds(contract["max_age"]), milliseconds(contract["stop_after"])
        self.period_ms = 1.0
        # Misses that the window may hold; one more, and the tick that finds it degrades.
        self.may_miss = int(float(contract["epsilon"]) * milliseconds(contract["window"]) / self.period_ms)
        self.run, ticks = run, run.ticks
        self.now_ms = ticks["now"].to_numpy() * 1e-6
        self.age_ms = ticks["age_ms"].to_numpy()
        self.mode, self.cause, self.player = (ticks[name].astype(str).to_numpy() for name in ("mode", "cause", "player"))
        self.usable = ticks["freshness"].astype(str).isin(["fresh", "aging"]).to_numpy()
        self.sent_ms = np.append(ticks["last_sent_at"].to_numpy()[1:], 0) * 1e-6  # of this tick's first frame; 0: none
        self.damped = np.append(ticks["last_damped"].to_numpy()[1:], 0) != 0
        self.arrival = ticks["arrival"].astype(str).to_numpy()

    def never_stale(self):
        """What is wrong with any tick of the run: a target that comes of a command that is too old, or of none."""
        wrong = []
        moved_by_policy = self.player == "policy"
        for what, bad in (("are younger than max_age by their verdict alone", self.usable & (self.age_ms > self.max_age_ms)),
                          ("follow a policy without a usable command", moved_by_policy & ~self.usable),
                          ("put a setpoint on the bus when its command was older than max_age",
                           moved_by_policy & ~self.damped & (self.sent_ms > 0) & (self.sent_ms - (self.now_ms - self.age_ms) > self.max_age_ms))):
            if bad.any():
                wrong.append(f"{bad.sum()} ticks {what}, the first at {np.flatnonzero(bad)[0]}")
        if moved_by_policy.sum() < 1000:
            wrong.append(f"the policy moved the robot for {moved_by_policy.sum()} ticks: nothing was tested")
        return wrong

    def commands_answer_their_observations(self, answered):
        """`answered`: numbers of the observations that the server answered well."""
        wrong, commands = [], self.run.commands
        number = np.array([q[0, SAYS] for q in commands["q"]]) / ONE if len(commands) else np.empty(0)
        claimed = commands["observation_id"].to_numpy()
        passed_off = claimed != number
        if passed_off.any():
            first = np.flatnonzero(passed_off)[0]
            wrong.append(f"{passed_off.sum()} of {len(claimed)} commands are answers to other questions: observation {claimed[first]} got the answer to {number[first]:g}")
        invented = set(claimed.tolist()) - answered
        if invented:
            wrong.append(f"{len(invented)} commands answer what the server did not, such as observation {min(invented)}")
        wrong += [f"{count} messages were refused as {name}" for name, count in collections.Counter(self.arrival[np.isin(self.arrival, NEVER)]).items()]
        return wrong

    def taken_in(self, begin_ms, end_ms):
        return ((self.now_ms >= begin_ms) & (self.now_ms <= end_ms) & (self.arrival == "accepted")).sum()

    def stop_in(self, begin_ms, end_ms):
        """The first latched stop in this time, and what is wrong with when it came; None: there was none."""
        latched = np.isin(self.mode, ["damped_stop", "fault_latched"])
        entered = latched & ~np.append(False, latched[:-1])
        within = np.flatnonzero((self.now_ms >= begin_ms) & (self.now_ms <= end_ms) & entered)
        if not len(within):
            return None
        stop = within[0]
        if self.cause[stop] != "command_lost":
            return Stop(self.cause[stop])
        last = np.flatnonzero(self.usable[:stop])[-1]
        expired_ms = self.now_ms[last] - self.age_ms[last] + self.max_age_ms
        degraded = last + np.flatnonzero(self.mode[last:] != "tracking")[0]
        late = (self.now_ms[last:degraded + 1] > expired_ms).sum()
        waited_ms = self.now_ms[stop] - self.now_ms[last]
        wrong = []
        if self.mode[degraded] != "degraded":
            wrong.append(f"it went to {self.mode[degraded]} without being degraded before")
        if late > self.may_miss + 1:
            wrong.append(f"degraded in tick {late} after the last command had expired, the robot file allows {self.may_miss + 1}")
        if self.now_ms[stop - 1] - self.now_ms[last] > self.stop_after_ms:
            wrong.append(f"stopped {waited_ms:.1f} ms after the last usable command, not in the first tick after {self.stop_after_ms:g} ms")
        told = f"last age {self.age_ms[last]:.1f} ms, degraded in tick {late} after the command expired, stopped {waited_ms:.1f} ms after the last usable one"
        return Stop("command_lost", told, wrong)
