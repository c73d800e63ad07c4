#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the wheel, in a fresh environment, is all that a numpy policy needs to drive the demo robot; what does not fit is refused in
one sentence; a policy sees what it asked for, and leaves cleanly. Method: `takt run` with real processes, policies of a few lines
written by the tests; the arm's true motion comes from the simulator. Usage: python_policy_test.py SOURCE_DIR BUILD_DIR
"""
import json
import re
import shutil
import sys
import unittest

import numpy as np

from python_rig import BUILD, SOURCE, PythonRig

SPEC = """
import json, os, signal, sys, time
import numpy as np
import takt
spec = takt.Policy(observation={"state": takt.joints("q", "dq"), "target": takt.stream("target", 3)},
                   action=takt.chunk("q", steps=16, step="10 ms"))
"""
HOLD = "obs.publish(q=np.tile(robot.home, (16, 1)))"


class PythonPolicy(PythonRig):
    def refusal(self, text, code):
        """The one line with which a policy of this text ends by itself, no robot running."""
        self.policy(text)
        done = self.command("./policy.py")
        self.assertEqual(done.returncode, code, done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        return done.stderr

    def connect(self, old="", new=""):
        return SPEC.replace(old, new) + "takt.connect('robot.yaml', spec)\n"

    def test_the_demo_arm_follows_the_target_under_numpy(self):
        self.policy((SOURCE / "docs/examples/numpy-policy/reach.py").read_text())
        done, log = self.run_robot("5s")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr + log)
        self.assertIn("tracking", done.stdout)
        rows = [json.loads(line) for line in (self.folder / "truth.jsonl").read_text().splitlines()]
        errors = sorted(row["error_m"] for row in rows[len(rows) // 2:])
        self.assertLess(errors[len(errors) // 2], 0.05, "it began 0.25 m away")
        replayed = self.command("takt", "replay", "run")
        self.assertEqual(replayed.returncode, 0, replayed.stdout)

    def test_a_policy_that_raises_is_heard(self):
        self.policy(f"""
import takt
{SPEC}
with takt.connect("robot.yaml", spec) as robot:
    for count, obs in enumerate(robot):
        if count == 20:
            raise ValueError("the arm is upside down")
""")
        done, _ = self.run_robot("2s")
        self.assertNotEqual(done.returncode, 0, done.stdout)
        self.assertIn("ValueError: the arm is upside down", done.stdout + done.stderr)

    def test_a_policy_on_a_server_moves_the_arm_and_the_servers_silence_stops_it(self):
        try:
            from openpi_server import OpenPiServer, array
            import msgpack
        except ImportError as error:
            self.skipTest(f"NO POLICY SERVER WAS TALKED TO: {error}")

        async def moves_and_falls_silent(peer, asked, count):
            if asked["mode"] == "tracking":
                moves_and_falls_silent.tracked += 1
            if moves_and_falls_silent.tracked < 60:
                away = 0.2 * min(moves_and_falls_silent.tracked / 60, 1)
                await peer.send(msgpack.packb({"actions": array([[value + away for value in asked["home"]]] * 16)}))
        moves_and_falls_silent.tracked = 0
        server = OpenPiServer(moves_and_falls_silent)
        self.addCleanup(server.close)
        self.policy(f"""
import time, numpy as np, takt
from takt import servers
{SPEC}
with takt.connect("robot.yaml", spec) as robot, servers.OpenPi("{server.url}", shape=(16, 6), deadline="200 ms") as server:
    for obs in robot:
        with obs.infer():
            q = server.infer({{"mode": obs.mode, "home": robot.home.tolist(), "state": obs.state, "target": obs.target}})
        if q is None:
            obs.withhold(server.problem)
        else:
            obs.publish(q=q, source=server.source)
""")
        done, log = self.run_robot("6s", may="network")
        for mode in ("tracking", "degraded", "damped_stop"):
            self.assertIn(mode, done.stdout + done.stderr + log)
        self.assertIn(f"{server.url} did not answer within 200 ms", log)
        self.assertNotIn("Traceback", log)
        moved = [json.loads(line)["q"][0] for line in (self.folder / "truth.jsonl").read_text().splitlines()]
        self.assertGreater(max(moved) - moved[0], 0.05)
        replayed = self.command("takt", "replay", "run")
        self.assertEqual(replayed.returncode, 0, replayed.stdout)
        # The run alone says whose commands moved the robot, and what failed.
        metrics = json.loads(self.command("takt", "report", "--json", "run").stdout)
        sources = [each["what"] for each in metrics["command_sources"]]
        self.assertEqual([source.split(",")[0] for source in sources], [server.url], sources)
        self.assertIn(f"policy: {server.url} did not answer within 200 ms", metrics["incidents"][0]["sentence"])

    def test_a_policy_sees_what_it_asked_for_and_leaves_on_a_signal(self):
        self.policy(SPEC + f"""
with takt.connect("robot.yaml", spec) as robot:
    seen, kept, newest = [], None, 0
    for obs in robot:
        if kept is None:
            kept = obs.state
            assert obs.reset and obs.state.shape == (2, 6) and obs.target.shape == (3,) and obs.state.dtype == np.float32, obs.state
            assert robot.joints[0] == "base_yaw" and robot.steps == 16 and abs(robot.period - 0.02) < 1e-9
            try:
                obs.state[0] = 1
                sys.exit("an observation was writable")
            except ValueError:
                pass
        assert kept.base is not None and np.shares_memory(kept, obs.state), "a copy"
        assert obs.id > newest, "not newer"
        newest = obs.id
        assert obs.sensed <= obs.time <= time.monotonic_ns()
        seen.append(obs.mode)
        with obs.infer():
            pass
        {HOLD}
        if obs.mode == "tracking" and seen.count("tracking") == 20:
            os.kill(os.getpid(), signal.SIGTERM)
assert abs(kept[0, 2] + 1.2) < 0.2, "may still be read"
print("left", sorted(set(seen)))
""")
        done, log = self.run_robot("3s")
        self.assertIn("left", log, done.stdout + done.stderr)
        self.assertIn("'tracking'", log)
        self.assertNotIn("Traceback", log)

    def test_a_wrong_shape_ends_the_policy_in_one_sentence(self):
        self.policy(SPEC + """
with takt.connect("robot.yaml", spec) as robot:
    for obs in robot:
        obs.publish(q=np.zeros((16, 5)))
""")
        _, log = self.run_robot("2s")
        self.assertIn("publish: q has the shape (16, 5), this robot's chunk (16, 6): (steps, joints)\n", log)
        self.assertNotIn("Traceback", log)

    def test_another_robot_file_is_refused_by_the_executive(self):
        # The policy says another file than the robot runs with: same policy, other limits.
        self.policy(self.connect() .replace("'robot.yaml', spec", "'other.yaml', spec, arguments=['--robot', 'other.yaml']"))
        (self.folder / "other.yaml").write_text((self.folder / "robot.yaml").read_text().replace("velocity: 3 rad/s", "velocity: 2 rad/s"))
        done, log = self.run_robot("2s")
        self.assertNotEqual(done.returncode, 0)
        self.assertRegex(log, r"configuration hash [0-9a-f]{16} is not the executive's [0-9a-f]{16}: start both with the same robot file")
        self.assertNotIn("Traceback", log)

    def test_what_does_not_fit_is_refused_in_one_sentence(self):
        for old, new, said in (
                ("steps=16", "steps=100", "policy.steps is 16, the policy's chunks have 100"),
                ('"10 ms"', '"33.3 ms"', "policy.step_period is 10 ms, the policy's is 33.3 ms"),
                ('"10 ms"', '"10"', 'step "10" of the policy'),
                ('"target", 3', '"cam0", 3', "stream 'cam0', which `sensors` does not list (there is target)"),
                ('"target", 3', '"target", 4', "sensor target has 3 values, the policy's stream of that name 4"),
                (', "target": takt.stream("target", 3)', "", "lists sensor target, which the policy does not read"),
                ('"q", "dq"', '"q", "speed"', "there is no quantity 'speed'"),
                ('"target", 3', '"target", 3, unit="m"', "sensor target gives unstated, the policy reads m: make them equal (`unit` there)"),
                ('"target", 3', '"target", 3, max_age="80 ms"', "sensor target has the timeout 200 ms, the policy's max_age is 80 ms: make them equal"),
                ('step="10 ms"', 'step="10 ms", join="smooth"', "takt.chunk: there is no join 'smooth'; there are replace, cross_fade,"),
                ('chunk("q"', 'chunk("tau"', "a chunk's targets are 'q' (rad), not 'tau'"),
                ('"state"', '"mode"', "an observation cannot be named 'mode'")):
            with self.subTest(said):
                self.assertIn(said, self.refusal(self.connect(old, new), 65))

    def test_a_join_is_the_robot_files(self):
        """Every name that takt.chunk takes is one that the library compares; rtc is prefix."""
        for join in ("replace", "blend", "ensemble", "align", "quintic", "prefix", "rtc"):
            with self.subTest(join):
                self.assertIn(f"policy.action.join is cross_fade, the policy's chunks are made for {join}: write `join: {{ kind: {'prefix' if join == 'rtc' else join} }}` "
                              "in policy.action there, or have the policy say cross_fade", self.refusal(self.connect('step="10 ms"', f'step="10 ms", join="{join}"'), 65))

    def test_a_sensor_publishes_in_place_and_says_what_cannot_be(self):
        self.policy("""
import time
import numpy as np
import takt
with takt.Sensor("target", "robot.yaml", shape=3, unit="unstated", runtime_dir="sensors") as sensor:
    assert abs(sensor.timeout - 0.2) < 1e-9 and sensor.unit == "unstated"
    first = sensor.values
    assert first.shape == (3,) and first.dtype == np.float32 and first.flags.writeable
    first[:] = 1, 2, 3
    sensor.publish()
    assert not np.shares_memory(first, sensor.values), "another slot"
    sensor.publish([4, 5, 6], stamp=time.monotonic_ns() - 1000)
    for wrong in (lambda: sensor.publish([1, 2]), lambda: sensor.publish(stamp=time.monotonic_ns() + 10**9),
                  lambda: takt.Sensor("target", "robot.yaml", shape=3, runtime_dir="sensors")):
        try:
            wrong()
            raise SystemExit("was not refused")
        except takt.Refused as refused:
            print(refused)
try:
    sensor.publish()
    raise SystemExit("was not refused")
except takt.Refused as refused:
    print(refused)
takt.Sensor("target", "robot.yaml", shape=4, runtime_dir="sensors")
""")
        done = self.command("./policy.py")
        self.assertEqual(done.returncode, 65, done.stdout + done.stderr)
        self.assertEqual(done.stderr, "robot.yaml: sensor target gives 3 values, this one 4: make them equal\n")
        for said in ("publish: the shape is (2,), the sensor's (3,)", "the stamp is after now", "sensor-target.sock", "sensor target: it is closed"):
            self.assertIn(said, done.stdout)

    def test_a_sensor_refuses_values_that_its_type_cannot_hold(self):
        """What is refused leaves the memory of the next sample as it was; what fits is taken, whatever type it comes in."""
        self.robot(lambda text: text.replace("sensors:\n", "sensors:\n  - { name: cam0, image: { height: 2, width: 2, channels: 1 }, timeout: 5 s }\n"))
        self.policy("""
import numpy as np
import takt
def publish(sensor, values):
    before = sensor.values.copy()
    try:
        sensor.publish(values)
    except takt.Refused as refused:
        assert refused.exit_code == 64 and np.array_equal(sensor.values, before), "written to"
        print(refused)
    else:
        print("taken")
with takt.Sensor("cam0", "robot.yaml", shape=(2, 2, 1), dtype="uint8", runtime_dir="sensors") as camera:
    image = np.full((2, 2, 1), 0.5)
    for values in (image, image.astype(np.float32), image > 0, 300 * (image > 0), (300 * (image > 0)).astype(np.uint16), -1 * (image > 0),
                   255 * (image > 0), [[[0], [1]], [[2], [3]]], [[[0], [1]], [[2], [2**70]]], image.astype(complex), image.astype(str)):
        publish(camera, values)
with takt.Sensor("target", "robot.yaml", shape=3, runtime_dir="sensors") as target:
    for values in (np.zeros(3), np.zeros(3, int), [1, 2, 3], np.zeros(3, complex), ["1", "2", "3"], [1, 2, None], [1e300, 0, 0]):
        publish(target, values)
    for stamp in (1.5, -1, 0):
        try:
            target.publish(np.zeros(3), stamp=stamp)
        except takt.Refused as refused:
            print(refused)
for shape, dtype in ((-1, "float32"), (2**40, "float32"), ((2, 0, 1), "uint8"), (3, "float64")):
    try:
        takt.Sensor("target", "robot.yaml", shape=shape, dtype=dtype, runtime_dir="sensors")
    except takt.Refused as refused:
        print(refused)
""")
        done = self.command("./policy.py")
        self.assertEqual(done.returncode, 0, done.stderr)
        of_camera, of_target = "sensor cam0: publish: ", "sensor target: publish: "
        floats = "cannot become uint8 without loss: give uint8, of an image from 0 to 1 the 255-fold, rounded"
        bounds = "is no uint8: values go from 0 to 255"
        self.assertEqual(done.stdout.splitlines(), [
            f"{of_camera}float64 {floats}", f"{of_camera}float32 {floats}", "taken", f"{of_camera}300 {bounds}", f"{of_camera}300 {bounds}", f"{of_camera}-1 {bounds}",
            "taken", "taken", f"{of_camera}object cannot become uint8 without loss: give uint8", f"{of_camera}complex128 cannot become uint8 without loss: give uint8",
            f"{of_camera}<U32 cannot become uint8 without loss: give uint8", "taken", "taken", "taken", f"{of_target}complex128 cannot become float32 without loss: give float32",
            f"{of_target}<U1 cannot become float32 without loss: give float32", f"{of_target}object cannot become float32 without loss: give float32",
            f"{of_target}1e+300 is more than float32 holds", *(f"{of_target}the stamp is {stamp}: give ns of time.monotonic_ns()" for stamp in (1.5, -1, 0)),
            *(f"takt.Sensor: shape {shape}: each of its numbers is from 1 to 2147483647" for shape in (-1, 2**40, (2, 0, 1))),
            "takt.Sensor: float64 of shape (3,): samples are float32 with one axis, or uint8 images with three: height, width, channels"])
        self.assertEqual(done.stderr, "")

    def test_a_policy_says_whether_it_fits_without_a_robot(self):
        self.policy(SPEC + """
with takt.connect("robot.yaml", spec) as robot:
    raise RuntimeError("nobody asked for a robot")
""")
        done = self.command("./policy.py", "--check")
        self.assertEqual((done.returncode, done.stdout, done.stderr), (0, "robot.yaml: the policy fits: state, target in, 16 steps of 6 joints out\n", ""))
        self.robot(lambda text: text.replace("  steps: 16\n", "  steps: 12\n"))
        done = self.command("./policy.py", "--check")
        self.assertEqual((done.returncode, done.stderr.count("\n")), (65, 1), done.stderr)

    def test_a_queue_gives_every_sample_or_says_how_many_are_missing(self):
        """A counter as a sensor at 400 Hz, read by a 50 Hz policy: what is seen and what is lost make up what was published."""
        def with_a_queue(text):
            text = text.replace("sensors:\n", "sensors:\n  - { name: fast, values: 2, timeout: 5 s, queue: 20 }\n")
            return re.sub(r"(?m)^(  observation:.*)$", r"\1\n    - { term: sensor, sensor: fast }", text)
        self.robot(with_a_queue)
        self.policy(f"""
import threading
{SPEC}
def count():
    with takt.Sensor("fast", "robot.yaml", shape=2) as fast:
        number = 0
        while number < 4000:
            number += 1
            fast.publish([number, -number])
            time.sleep(0.0025)
threading.Thread(target=count, daemon=True).start()
spec = takt.Policy(observation={{**spec.observation, "fast": takt.queue("fast", 2)}}, action=spec.action)
with takt.connect("robot.yaml", spec) as robot:
    seen, most, paused = [], 0, False
    for obs in robot:
        values = obs.fast
        assert values.shape == (len(obs.stamps("fast")), 2) and np.array_equal(values[:, 0], -values[:, 1]), values
        assert np.all(np.diff(obs.stamps("fast")) > 0) and (not len(values) or obs.sensed <= obs.stamps("fast")[-1])
        before = seen[-1] if seen else None
        if before is not None and len(values):
            assert values[-1, 0] - before == len(values) + obs.lost("fast"), (before, values, obs.lost("fast"))
            assert len(values) == 20 or not obs.lost("fast"), (len(values), obs.lost("fast"))
        seen += values[:, 0].tolist()
        most = max(most, len(values))
        if not paused and obs.id >= 40:
            paused = True
            time.sleep(0.2)  # some 80 samples, of which 20 stay
        {HOLD}
        if len(seen) > 1000:
            open("saw", "w").write(json.dumps([most, len(seen)]))
""")
        done, log = self.run_robot("5s", may="everything")  # the policy is a sensor too
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr + log)
        self.assertNotIn("Traceback", log)
        most, seen = json.loads((self.folder / "saw").read_text())
        self.assertEqual(most, 20, "after the pause the queue was full")
        self.assertGreater(seen, 1000)

    def test_the_run_has_what_a_policy_was_shown_images_too(self):
        """Every image is another one and tells its number; what the policy saw is compared with the run, what the camera sent with the files. The budget
        is spent on the way: the rest is named by hash, and declared. A file that is lost afterwards is told.
        """
        try:
            import pandas  # noqa: F401
            import zstandard  # noqa: F401
        except ImportError as error:
            self.skipTest(f"NO RUN WAS READ: {error}")
        import hashlib
        import takt

        def with_a_camera(text):
            text = text.replace("sensors:\n", "sensors:\n  - { name: cam0, image: { height: 24, width: 32, channels: 3 }, timeout: 5 s }\n")
            text = text.replace("record:\n", "record:\n  images: { budget_mib: 0.05 }\n")
            return re.sub(r"(?m)^(  observation:.*)$", r"\1\n    - { term: sensor, sensor: cam0 }", text)
        self.robot(with_a_camera)
        self.policy(f"""
import threading
{SPEC}
def film():
    with takt.Sensor("cam0", "robot.yaml", shape=(24, 32, 3), dtype="uint8") as camera:
        number = 0
        while True:
            number += 1
            camera.values[:] = np.random.default_rng(number).integers(0, 256, (24, 32, 3), np.uint8)
            camera.values[0, 0] = number % 256, number // 256, 0
            camera.publish()
            time.sleep(1 / 30)
threading.Thread(target=film, daemon=True).start()
spec = takt.Policy(observation={{**spec.observation, "top": takt.image("cam0")}}, action=spec.action)
with takt.connect("robot.yaml", spec) as robot, open("saw", "w") as saw:
    for count, obs in enumerate(robot):
        {HOLD}
        row = [obs.id, obs.state[0].tolist(), obs.state[1].tolist(), obs.target.tolist(), int(obs.top[0, 0, 0]) + 256 * int(obs.top[0, 0, 1])]
        print(json.dumps(row), file=saw, flush=True)
""")
        done, log = self.run_robot("4s", may="everything")  # the policy is a sensor too
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr + log)
        self.assertNotIn("Traceback", log)

        def sent(number):
            image = np.random.default_rng(number).integers(0, 256, (24, 32, 3), np.uint8)
            image[0, 0] = number % 256, number // 256, 0
            return image

        run = takt.open(self.folder / "run")
        shown = run.policy_inputs.set_index("observation_id")
        self.assertTrue(shown["by_client"].all())
        hashes = {digest: number for number in range(1, 400) for digest in [hashlib.sha256(b"P6\n32 24\n255\n" + sent(number).tobytes()).hexdigest()]}
        rows = [json.loads(line) for line in (self.folder / "saw").read_text().splitlines()]
        compared = 0
        for observation, q, dq, target, number in rows:
            if observation not in shown.index:  # the monitor came later, or had left
                continue
            compared += 1
            row = shown.loc[observation]
            self.assertEqual((row["q"].tolist(), row["dq"].tolist()), (q, dq))
            self.assertEqual(len(row["tau"]), 0, "no term names it")
            values = dict(zip(row["sample_sensor"].tolist(), row["sample_values"]))
            self.assertEqual(values[1].tolist(), target)
            named = row["sample_image"][row["sample_sensor"].tolist().index(0)]
            if named:
                self.assertEqual(hashes[named], number)
        self.assertGreater(compared, len(rows) // 2)
        self.assertGreater(compared, 50)
        sensed = run.sensors
        self.assertFalse(sensed.duplicated(["sensor", "sequence"]).any(), "each process began once")
        frames = sensed[sensed["sensor"] == "cam0"]
        self.assertGreater(len(frames), 50)
        self.assertEqual(set(frames["image"]) - {""}, set(run.images["sha256"]) - {""})
        targets = set(map(tuple, np.stack(sensed[sensed["sensor"] == "target"]["values"]).tolist()))
        self.assertLessEqual({tuple(target) for observation, _, _, target, _ in rows if observation in shown.index}, targets)
        images = run.images.set_index("sha256")
        stored = images.index[images["file"] == "stored"]
        self.assertEqual(len(stored), int(0.05 * 2**20 / (24 * 32 * 3 + len(b"P6\n32 24\n255\n"))), "as many as the budget holds")
        for digest in stored:
            np.testing.assert_array_equal(run.image(digest), sent(hashes[digest]))
        over = int((images["file"] == "over_budget").sum())
        self.assertGreater(over, 10)
        declared = run.losses.groupby(["ring", "reason"])["count"].sum()
        self.assertEqual(declared["image", "over_budget"], over)
        self.assertEqual(run.manifest["losses"]["totals"]["image over_budget"], over)
        lost = run.folder / "images" / f"{stored[0]}.ppm"
        lost.unlink()
        again = takt.open(run.folder)
        self.assertEqual(again.images.set_index("sha256")["file"][stored[0]], "lost")
        with self.assertRaisesRegex(takt.Refused, f"{lost.name} is missing: it was lost since the run"):
            again.image(stored[0])
        replayed = self.command("takt", "policy", "replay", "run")
        self.assertEqual(replayed.returncode, 65, replayed.stdout)
        self.assertIn("is a program of its own (takt/client.h)", replayed.stderr)

    def test_a_python_file_as_policy_is_the_program_that_runs(self):
        (self.folder / "another.py").write_text("")
        self.robot(lambda text: text.replace("file: policy.py", "file: another.py"))
        self.assertRegex(self.refusal(self.connect(), 65), r"policy.file is \S+/another.py, and the program that runs is \S*policy.py")

    def test_what_needs_the_built_in_engine_refuses_a_python_policy_in_one_sentence(self):
        self.policy(self.connect())
        for arguments in (("deploy", "robot.yaml", "--store", "store", "--runs", "runs", "--runtime-dir", "rt", "--no-restart"),
                          ("margin", "robot.yaml")):
            done = self.command("takt", *arguments)
            self.assertIn(done.returncode, (1, 65), done.stderr)
            self.assertRegex(done.stderr, r"policy.py: not an ONNX model, .* runs by --policy-host")
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)

    def test_a_checkout_that_is_built_needs_no_installation(self):
        shutil.copytree(SOURCE / "client/python/takt", self.folder / "checkout/client/python/takt")
        (self.folder / "checkout/build/release").mkdir(parents=True)
        words = ("env", f"PYTHONPATH={self.folder}/checkout/client/python", "/usr/bin/python3", "-c", "from takt import _library; _library.load()")
        missing = self.command(*words)
        self.assertEqual(missing.returncode, 1, missing.stdout)
        self.assertIn("or in a checkout run ./dev build", missing.stderr)
        (self.folder / "checkout/build/release/lib").symlink_to(BUILD / "lib")
        self.assertEqual(self.command(*words).returncode, 0)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
