#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: takt.open gives what a run and a panel left behind, as tables that agree with what was computed from the same files elsewhere; what is cut off or
is something else is said in one sentence. Method: a recorded run of the demo arm and a sample artifact, made by the build; metrics.json, transitions.jsonl,
the Parquet file's twin and what the writer of policy inputs says it wrote are the judges. Usage: open_run_test.py SOURCE_DIR MAKE_RECORDED_DEMO
MAKE_SAMPLE_ARTIFACT MAKE_POLICY_INPUTS. Exit code 77: pandas or zstandard is missing.
"""
import json
import os
import pathlib
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

SOURCE, MAKE_RUN, MAKE_ARTIFACT, MAKE_INPUTS = (pathlib.Path(argument).resolve() for argument in sys.argv[1:5])
sys.dont_write_bytecode = True
sys.path.insert(0, str(SOURCE / "client/python"))
try:
    import pandas
    import zstandard  # noqa: F401
except ImportError as error:
    print(f"SKIPPED: {error}: NO RUN WAS READ")
    sys.exit(77)
import numpy as np  # noqa: E402

import takt  # noqa: E402


class OpenRun(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.temporary = tempfile.TemporaryDirectory()
        cls.folder = pathlib.Path(cls.temporary.name)
        subprocess.run([MAKE_RUN, cls.folder / "run"], cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
        subprocess.run([MAKE_ARTIFACT, cls.folder / "panel"], cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
        cls.run_ = takt.open(cls.folder / "run")
        cls.metrics = json.loads((cls.folder / "run/metrics.json").read_text())

    @classmethod
    def tearDownClass(cls):
        cls.temporary.cleanup()

    def test_ticks_are_those_of_the_report(self):
        ticks = self.run_.ticks
        self.assertEqual(len(ticks), self.metrics["ticks"]["recorded"])
        self.assertTrue((np.diff(ticks["tick"]) == 1).all())
        self.assertEqual(ticks["s"].iloc[0], 0)
        self.assertAlmostEqual(ticks["s"].iloc[-1], 1e-9 * self.metrics["ticks"]["span_ns"], places=9)
        modes = ticks["mode"].value_counts()
        for mode, count in self.metrics["ticks_in_mode"].items():
            self.assertEqual(modes.get(mode, 0), count, mode)
        relied = ticks[ticks["previous_mode"].isin(["tracking", "degraded"])]
        self.assertAlmostEqual(relied["age_ms"].max(), 1e-6 * self.metrics["age_ns"]["per_tick"]["total"]["max"], places=6)

    def test_what_was_not_heard_yet_is_nan(self):
        run = takt.open(self.folder / "run")
        array, first = run.tick_array.copy(), run.joints[0]
        array["feedback_received_at"][0] = 0
        run.__dict__["tick_array"] = array
        ticks = run.ticks
        self.assertTrue(ticks[[f"feedback_q.{first}", f"q_estimate.{first}", f"tau_gravity.{first}"]].iloc[0].isna().all())
        self.assertFalse(ticks[f"feedback_q.{first}"].iloc[1:].isna().any())
        self.assertEqual(ticks[f"kp_command.{first}"].iloc[0], array["kp_command"][0, 0])

    def test_joints_and_buses_have_columns_of_their_own(self):
        ticks, array = self.run_.ticks, self.run_.tick_array
        self.assertEqual(self.run_.joints[2], "elbow")
        np.testing.assert_array_equal(ticks["q_estimate.elbow"], array["q_estimate"][:, 2])
        self.assertEqual(sum(name.startswith("bus_state.") for name in ticks), len(self.run_.buses))
        self.assertEqual(set(ticks[f"feedback_drive_state.{self.run_.joints[0]}"]), {"enabled", "disabled"})
        self.assertEqual(self.run_.enumerations["mode"][2], "tracking")
        self.assertEqual(self.run_.enumerations["previous_mode"], self.run_.enumerations["mode"])
        self.assertEqual(self.run_.about["q_estimate"], "output; rad, of a slide m")

    def test_commands_are_the_messages_of_the_policy(self):
        commands = self.run_.commands
        read = self.run_.ticks.set_index("tick")["arrival"].loc[commands["tick"]]
        by_arrival = read.value_counts()
        for arrival, count in self.metrics["arrivals"].items():
            if arrival not in ("none", "contended", "corrupt"):
                self.assertEqual(by_arrival.get(arrival, 0), count, arrival)
        whole = commands[commands["q"].notna()]
        self.assertEqual({steps.shape for steps in whole["q"]}, {(int(whole["step_count"].iloc[0]), 6)})
        self.assertEqual(set(commands["sender"]), {"policy"})
        self.assertTrue(np.isfinite(np.stack(whole["q"])).all())

    def test_policy_inputs_are_what_the_host_published(self):
        subprocess.run([MAKE_INPUTS, self.folder / "shown"], cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
        told = json.loads((self.folder / "shown/inputs.json").read_text())
        found = takt.open(self.folder / "shown").policy_inputs
        self.assertEqual([len(inputs["sample_values"]) for inputs in told], [0, 1, 3, 3], "with samples and without")
        self.assertEqual(len(found), len(told))
        for (_, row), wanted in zip(found.iterrows(), told):
            self.assertEqual([values.tolist() for values in row["sample_values"]], wanted.pop("sample_values"))
            for name, value in wanted.items():
                self.assertEqual(row[name].tolist() if isinstance(value, list) else row[name], value, name)
        self.assertEqual({values.dtype for values in found["input"]}, {np.dtype("<f4")})

    def test_sensors_are_every_sample_once(self):
        """Names and units are those of the robot file, whose `sensors` the test writes; the third one sends nothing."""
        subprocess.run([MAKE_INPUTS, self.folder / "sensed"], cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
        told = json.loads((self.folder / "sensed/inputs.json").read_text())
        config = self.folder / "sensed/config.yaml"
        text, rest = config.read_text().split("sensors:\n")
        rest = rest[re.search(r"(?m)^\S", rest).start():]
        sensors = [f'  - name: {name}\n    values: 2\n    queue: 0\n    unit: "{unit}"\n    ros:\n      joints:\n        - name: not_a_sensor\n'
                   for name, unit in (("target", 'm \\"here\\"'), ("force", "N"), ("wish", "m/s"), ("base_imu", "unstated"))]
        config.write_text(text + "sensors:\n" + "".join(sensors) + "imu:\n  sensor: base_imu\n  tilt: 1 rad\n" + rest)
        run = takt.open(self.folder / "sensed")
        found = run.sensors
        self.assertEqual(list(found.columns), ["s", "sensor", "sequence", "sensed_at", "published_at", "values", "unit", "image"])
        self.assertFalse(found.duplicated(["sensor", "sequence", "sensed_at"]).any())
        self.assertTrue(found["sensed_at"].is_monotonic_increasing)
        np.testing.assert_allclose(found["s"], (found["sensed_at"] - run.ticks["now"].iloc[0]) * 1e-9)
        self.assertEqual(found["sensor"].value_counts().to_dict(), {"base_imu": 12, "target": 2, "force": 1})
        imu = found[found["sensor"] == "base_imu"]
        self.assertEqual(imu["sequence"].tolist(), list(range(1, 13)))
        self.assertTrue(imu["published_at"].isna().all())
        np.testing.assert_array_equal(np.stack(imu["values"]), [[1, 0, 0, 0, 0, 0, 0, n, n + 0.25, n + 0.5] for n in range(1, 13)])
        image, target = (row for _, row in found[found["sensor"] == "target"].iterrows())
        self.assertEqual((image["image"], len(image["values"]), image["published_at"]), (run.images["sha256"][0], 0, 1001))
        self.assertEqual((target["values"].tolist(), target["unit"], target["image"]), (told[2]["sample_values"][0], 'm "here"', ""))
        self.assertEqual(target["values"].dtype, np.dtype("<f4"))
        config.unlink()
        with self.assertRaisesRegex(takt.Refused, "config.yaml cannot be read"):
            takt.open(self.folder / "sensed").sensors

    def test_a_runs_own_config_names_its_sensors(self):
        """The robot file as the recorder wrote it; what it does not list has no name."""
        subprocess.run([MAKE_INPUTS, self.folder / "named"], cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
        found = takt.open(self.folder / "named").sensors
        self.assertEqual(found["sensor"].tolist(), ["target", "target", None])
        self.assertEqual(found["unit"].tolist(), ["unstated", "unstated", None])

    def test_images_are_those_that_were_shown_and_what_is_lost_or_altered_is_told(self):
        subprocess.run([MAKE_INPUTS, self.folder / "seen"], cwd=SOURCE, check=True, stdout=subprocess.DEVNULL)
        told = json.loads((self.folder / "seen/images.json").read_text())
        run = takt.open(self.folder / "seen")
        self.assertEqual(list(run.images["file"]), ["stored", "over_budget"])
        self.assertEqual(list(run.images["sha256"]), [told["kept"], told["not_kept"]])
        by_client = run.policy_inputs[run.policy_inputs["by_client"]]
        self.assertEqual(by_client["sample_image"].tolist(), [[told["kept"]]])
        image = run.image(told["kept"])
        self.assertEqual((image.dtype, image.shape), (np.dtype("uint8"), tuple(told["shape"])))
        self.assertEqual(image.ravel().tolist(), told["bytes"])
        for digest, said in ((told["not_kept"], "went without a file, over_budget"), ("0" * 64, "no policy was shown"), ("", "no policy was shown")):
            with self.assertRaisesRegex(takt.Refused, said):
                run.image(digest)
        file = self.folder / "seen/images" / (told["kept"] + ".ppm")
        content = file.read_bytes()
        file.write_bytes(content[:-1] + b"x")
        with self.assertRaisesRegex(takt.Refused, "is not what was recorded"):
            run.image(told["kept"])
        file.unlink()
        with self.assertRaisesRegex(takt.Refused, "is missing: it was lost since the run"):
            run.image(told["kept"])
        self.assertEqual(takt.open(self.folder / "seen").images["file"][0], "lost")

    def test_a_run_without_policy_inputs_has_an_empty_table_of_them(self):
        inputs = self.run_.policy_inputs
        self.assertEqual(len(inputs), 0)
        self.assertIn("sample_values", inputs.columns)
        self.assertEqual(len(self.run_.images), 0)
        self.assertEqual(len(self.run_.sensors), 0)
        self.assertIn("values", self.run_.sensors.columns)

    def test_transitions_name_their_causes(self):
        lines = (self.folder / "run/transitions.jsonl").read_text().splitlines()
        self.assertEqual(list(self.run_.transitions["cause"]), [json.loads(line)["cause"] for line in lines])
        self.assertEqual(len(self.run_.losses), 0)
        self.assertEqual(list(self.run_.losses.columns), ["ring", "reason", "count", "after_tick", "before_tick"])

    def test_events_stand_at_the_ticks_in_which_they_happened(self):
        run = takt.open(self.copy_of_run("told"))
        (run.folder / "events.jsonl").unlink(missing_ok=True)
        self.assertEqual(list(run.events.columns), ["tick", "monotonic_ns", "utc", "event"])
        now = run.tick_array["now"]
        lines = [{"event": "run", "monotonic_ns": int(now[0]) - 5}, {"event": "ended", "monotonic_ns": int(now[40]), "process": "takt-policy-host"},
                 {"event": "ended", "monotonic_ns": int(now[41]) - 1}, {"event": "late", "monotonic_ns": 1 << 70}, 7, {"event": "no time"}]
        (run.folder / "events.jsonl").write_text("".join(json.dumps(line) + "\n" for line in lines))
        events = takt.open(run.folder).events
        ticks = [int(tick) for tick in run.tick_array["tick"][[40, 40, -1]]]
        self.assertEqual(list(events["tick"]), [-1, *ticks])
        self.assertEqual(list(events["process"][1:2]), ["takt-policy-host"])

    def test_an_artifacts_rows_are_those_of_its_parquet_twin(self):
        artifact = takt.open(self.folder / "panel")
        lines = [json.loads(line) for line in (self.folder / "panel/rollouts.jsonl").read_text().splitlines()]
        self.assertEqual(len(artifact.rows), len(lines))
        self.assertEqual(artifact.rows["age_per_tick.total.p99_ms"].iloc[0], lines[0]["age_per_tick"]["total"]["p99_ms"])

    def test_what_was_cut_off_is_read_as_far_as_it_goes(self):
        cut = self.folder / "cut"
        cut.mkdir()
        for name in ("manifest.json", "transitions.jsonl"):
            (cut / name).write_bytes((self.folder / "run" / name).read_bytes()[:None if name == "manifest.json" else -9])
        data = (self.folder / "run/ticks.mcap").read_bytes()
        (cut / "ticks.mcap").write_bytes(data[:len(data) * 2 // 3])
        run = takt.open(str(cut))
        self.assertGreater(len(run.ticks), 1000)
        pandas.testing.assert_frame_equal(run.ticks, self.run_.ticks.iloc[:len(run.ticks)])
        self.assertEqual(len(run.transitions), len(self.run_.transitions) - 1)

    def copy_of_run(self, name):
        copy = self.folder / name
        shutil.copytree(self.folder / "run", copy)
        return copy

    def test_what_all_chunks_together_may_cost_is_bounded(self):
        """Each of 40 stays below the limit of one: one record that no version knows, records without content, and messages without one."""
        data = (self.folder / "run/ticks.mcap").read_bytes()
        places = list(self.records(data))
        end = [behind[0] for (_, opcode), behind in zip(places, places[1:]) if opcode == 6][-1]
        noise, size = random.Random(7).randbytes(10_000), 8 << 20
        message = b"\x05" + struct.pack("<QHIQQ", 22, 1, 0, 0, 0)
        for name, plain in (("one", b"\x63" + struct.pack("<Q", size) + bytes(size)), ("empty", bytes(size)), ("messages", message * (size // len(message)))):
            packed = zstandard.compress(plain + noise)
            body = struct.pack("<QQQI", 0, 0, len(plain) + len(noise), 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
            self.assertGreater(len(packed) * 1000, len(plain))
            bombs = self.copy_of_run(name)
            (bombs / "ticks.mcap").write_bytes(data[:end] + (b"\x06" + struct.pack("<Q", len(body)) + body) * 40)
            run = takt.open(bombs)
            self.assertGreaterEqual(run.damaged_chunks, 20, name)
            if name != "messages":
                pandas.testing.assert_frame_equal(run.ticks, self.run_.ticks)

    def test_a_damaged_chunk_is_left_out_and_counted(self):
        """A byte is changed somewhere, and a chunk added that claims more than its bytes can hold: what is given is what was recorded."""
        data = (self.folder / "run/ticks.mcap").read_bytes()
        ends = [place for place, opcode in self.records(data) if opcode == 6]
        bomb = zstandard.compress(bytes(64 << 20))
        body = struct.pack("<QQQI", 0, 0, 64 << 20, 0) + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(bomb)) + bomb
        data = data[:ends[1]] + b"\x06" + struct.pack("<Q", len(body)) + body + data[ends[1]:]
        bombed = self.copy_of_run("bombed")
        (bombed / "ticks.mcap").write_bytes(data)
        run = takt.open(bombed)
        self.assertEqual(run.damaged_chunks, 1)
        pandas.testing.assert_frame_equal(run.ticks, self.run_.ticks)
        chosen, altered = random.Random(7), self.copy_of_run("altered")
        known, opened = set(map(bytes, self.run_.tick_array)), 0
        for _ in range(40):
            flipped = bytearray(data)
            flipped[chosen.randrange(9, len(flipped))] ^= 1 << chosen.randrange(8)
            (altered / "ticks.mcap").write_bytes(flipped)
            try:
                run = takt.open(altered)
                ticks = run.tick_array
            except takt.Refused:
                continue
            opened += 1
            self.assertLessEqual(set(map(bytes, ticks)), known)
        self.assertGreater(opened, 20)

    @staticmethod
    def records(data):
        place = 8
        while place + 9 <= len(data):
            yield place, data[place]
            place += 9 + int.from_bytes(data[place + 1:place + 9], "little")

    def test_no_pipe_device_or_endless_nesting_holds_a_reader(self):
        for name in ("manifest.json", "ticks.mcap", "transitions.jsonl"):
            folder = self.copy_of_run(f"holes-{name}")
            os.truncate(folder / name, 1 << 40)
            with self.assertRaisesRegex(takt.Refused, "most of it are holes"):
                run = takt.open(folder)
                (run.tick_array, run.transitions)
        for name in ("manifest.json", "ticks.mcap", "transitions.jsonl"):
            folder = self.copy_of_run(f"piped-{name}")
            (folder / name).unlink()
            os.mkfifo(folder / name)
            with self.assertRaisesRegex(takt.Refused, "not a regular file|neither a run folder"):
                run = takt.open(folder)
                self.assertIsNotNone(run.ticks if name != "transitions.jsonl" else run.transitions)
        folder = self.copy_of_run("linked")
        (folder / "manifest.json").unlink()
        (folder / "manifest.json").symlink_to("/dev/zero")
        with self.assertRaisesRegex(takt.Refused, "not a regular file"):
            takt.open(folder)
        folder = self.copy_of_run("nested")
        (folder / "manifest.json").write_text("[" * 200_000)
        with self.assertRaisesRegex(takt.Refused, "nested too deeply"):
            takt.open(folder)

    def test_what_is_something_else_is_said_in_one_sentence(self):
        other = self.folder / "other"
        other.mkdir()
        with self.assertRaisesRegex(takt.Refused, "neither a run folder nor a panel's artifact"):
            takt.open(other)
        (other / "ticks.mcap").write_bytes(b"no such thing")
        with self.assertRaisesRegex(takt.Refused, "manifest.json cannot be read"):
            takt.open(other)
        (other / "manifest.json").write_text('{"joints": [], "buses": []}')
        with self.assertRaisesRegex(takt.Refused, "is no MCAP file"):
            takt.open(other).ticks
        (other / "ticks.mcap").write_bytes((self.folder / "run/ticks.mcap").read_bytes()[:8])
        with self.assertRaisesRegex(takt.Refused, "has no topic /takt/tick"):
            takt.open(other).ticks


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
