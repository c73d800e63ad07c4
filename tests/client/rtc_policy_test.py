#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: what an author of a policy with real-time chunking writes works as written: connected with join="rtc", it is given what will be played whatever it
answers, where its network expects it, and what it goes on from is what the robot did. Method: `takt run` with real processes; the recorded run is the judge
of what obs.committed said, from the messages of the policy and the executive's references. Usage: rtc_policy_test.py SOURCE_DIR BUILD_DIR. Exit code 77:
pandas or zstandard is missing.
"""
import json
import sys
import unittest

import numpy as np

from python_rig import SOURCE, PythonRig

try:
    import pandas  # noqa: F401
    import zstandard  # noqa: F401
except ImportError as error:
    print(f"SKIPPED: {error}: NO RUN WAS READ")
    sys.exit(77)
import takt  # noqa: E402

STEP_NS = 10_000_000
# Another goal at every observation, and an inference that takes some steps: an answer that does not go on from what is being played would jump.
POLICY = """
import json, time
import numpy as np
import takt
spec = takt.Policy(observation={"state": takt.joints("q", "dq")}, action=takt.chunk("q", steps=40, step="10 ms", join=JOIN))
random = np.random.default_rng(1)
with takt.connect("robot.yaml", spec) as robot, open("said", "w") as said:
    for obs in robot:
        with obs.infer():
            time.sleep(0.03)
            known = obs.committed
            assert known.dtype == np.float32 and known.shape == (len(known), 6) and not known.flags.writeable, known
            start = known[-1] if len(known) else obs.state[0]
            along = np.clip((np.arange(40) - max(len(known) - 1, 0)) / 36, 0, 1)[:, None]
            goal = robot.home + random.uniform(-0.05, 0.05, 6)
            q = (start + (goal - start) * along ** 2 * (3 - 2 * along)).astype(np.float32)
            q[:len(known)] = known
        obs.publish(q=q)
        print(json.dumps([obs.id, obs.time, known.tolist(), obs.committed_steps]), file=said, flush=True)
"""

# What a camera and a person's stick say, and a network that goes on from the prefix; then docs/python-policy.md's policy, word for word.
AROUND = """
import threading, time
import numpy as np
import takt

def play(sensor, period):
    with sensor:
        while True:
            sensor.values[...] = 7
            sensor.publish()
            time.sleep(period)

threading.Thread(target=lambda: play(takt.Sensor("cam0", "robot.yaml", shape=(24, 32, 3), dtype="uint8"), 0.02), daemon=True).start()
threading.Thread(target=lambda: play(takt.Sensor("cmd_vel", "robot.yaml", shape=3, unit="m/s"), 0.02), daemon=True).start()
log = open("said", "w")

def net(state, top, prefix):
    assert state.shape == (2, 6) and top.shape == (24, 32, 3) and top.dtype == np.uint8 and (top == 7).all(), (state, top)
    print(len(prefix), file=log, flush=True)
    actions = np.repeat(state[:1], 100, axis=0)
    actions[:len(prefix)] = prefix
    actions[len(prefix):] = prefix[-1] if len(prefix) else state[0]
    return actions
"""


def path(chunk, since_ns):
    """Where a chunk with straight lines between its steps is, so long after its first one."""
    at = np.clip(since_ns / STEP_NS, 0, len(chunk) - 1)
    step = min(int(at), len(chunk) - 2)
    return chunk[step] + (at - step) * (chunk[step + 1] - chunk[step])


class RtcPolicy(PythonRig):
    def setUp(self):
        super().setUp()
        # Patient: 400 ms of chunk, of which a stalled machine may play much before the next answer. At full speed at once.
        self.replace(("  max_age: 150 ms", "  max_age: 400 ms"), ("  resume_over: 3 s ", "  resume_over: 1 ms "), ("  steps: 16\n", "  steps: 40\n"), ("  period: 20 ms", "  period: 80 ms"),
                     ("    - { term: sensor, sensor: target, scale: 1, history: 2 }    # newest last\n", ""))

    def followed(self, join, duration):
        self.policy(POLICY.replace("JOIN", repr(join)))
        done, log = self.run_robot(duration, may="everything")  # its sensors are threads of the policy
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr + log)
        self.assertNotIn("Traceback", log)
        return [json.loads(line) for line in (self.folder / "said").read_text().splitlines()], takt.open(self.folder / "run")

    def test_what_it_is_told_will_be_played_is_played_and_it_goes_on_from_there(self):
        self.replace(("join: { kind: cross_fade }", "join: { kind: prefix, longest: 70 ms }"))
        said, run = self.followed("rtc", "8s")
        ticks, commands = run.ticks, run.commands.drop_duplicates("sequence").set_index("sequence")
        answers = commands.reset_index().drop_duplicates("observation_id").set_index("observation_id")["sequence"]
        published = ticks.drop_duplicates("observation_published").set_index("observation_published")["now"]
        now, in_use = ticks["now"].to_numpy(), ticks["command_sequence"].to_numpy()
        is_played = ((ticks["player"] == "policy") & (ticks["mode"] == "tracking")).to_numpy()
        reference = ticks[[f"q_reference.{joint}" for joint in run.joints]].to_numpy()

        def chunk_of(sequence):
            return np.asarray(commands.loc[sequence, "q"]), int(published[commands.loc[sequence, "observation_id"]])

        kept, seams, rows, told = 0, [], 0, 0
        for observation, time, known, (publish, first, count) in said:
            uses = np.flatnonzero(in_use == answers.get(observation, 0))
            if not known or not len(uses) or not uses[0] or not is_played[uses[0] - 1:uses[0] + 1].all():
                continue
            self.assertEqual((len(known), int(published[observation])), (count, time))
            taken = uses[0]
            played, begins = chunk_of(in_use[taken - 1])
            for i, row in enumerate(known):
                np.testing.assert_allclose(row, path(played, time + i * STEP_NS - begins), atol=1e-5)
                rows += 1
            # What the drives were told in the ticks between is what the rows say, where they were on the path to begin with (a late answer's jump
            # takes a while) and but for the limit of acceleration.
            last_row = time + (len(known) - 1) * STEP_NS
            between = np.flatnonzero((now >= time) & (now < min(last_row, now[taken])) & (in_use == in_use[taken - 1]))
            off = [np.abs(reference[tick] - path(np.asarray(known), now[tick] - time)).max() for tick in between]
            if off and off[0] < 2e-3:
                self.assertLess(max(off), 5e-3)
                told += len(off)
            if in_use[taken - 1] == publish:
                self.assertGreaterEqual(now[taken], begins + (first + count - 1) * STEP_NS, "an answer took over inside the promise")
                kept += 1
            if now[taken] <= last_row:
                mine, its_begin = chunk_of(in_use[taken])
                seams.append(np.abs(path(mine, now[taken] - its_begin) - path(played, now[taken] - begins)).max())
        print(f"{rows} rows of {kept} promises kept, as played in {told} ticks; {len(seams)} seams of at most {max(seams, default=0):.2e} rad")
        self.assertGreater(kept, 30)
        self.assertGreater(told, 300)
        self.assertGreater(len(seams), 20)
        self.assertLess(max(seams), 5e-4, "a step's motion is up to 4e-3, another goal 5e-2")

    def test_the_policy_of_the_page_runs_as_written(self):
        page = (SOURCE / "docs/python-policy.md").read_text()
        written = page.split("## Write it")[1].split("```python\n")[1].split("```")[0]
        self.replace(("  steps: 40\n", "  steps: 100\n"), ("  step_period: 10 ms", "  step_period: 33.3 ms"), ("join: { kind: cross_fade }", "join: { kind: prefix, longest: 70 ms }"),
                     ("sensors:\n", "sensors:\n  - { name: cam0, image: { height: 24, width: 32, channels: 3 }, timeout: 80 ms }\n"
                                    "  - { name: cmd_vel, values: 3, timeout: 500 ms, unit: m/s }\n"),
                     ("  observation:                # in input order\n", "  observation:\n    - { term: sensor, sensor: cam0 }\n    - { term: sensor, sensor: cmd_vel }\n"))
        self.policy(AROUND + written)
        done, log = self.run_robot("5s", may="everything")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr + log)
        self.assertNotIn("Traceback", log)
        self.assertIn("tracking", done.stdout)
        self.assertGreater(sum(int(line) > 0 for line in (self.folder / "said").read_text().splitlines()), 10)

    def test_nothing_is_promised_without_that_join(self):
        said, run = self.followed(None, "3s")
        self.assertIn("tracking", set(run.ticks["mode"]))
        self.assertGreater(len(said), 10)
        for _, _, known, (_, _, count) in said:
            self.assertEqual((known, count), ([], 0))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
