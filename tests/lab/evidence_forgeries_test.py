#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: no edit of a finished artifact, of a run folder or of an attestation passes for the thing itself. Method: a table of edits, each in a
copy of its own and refused by the sentence beside it. First each edit alone: the audit refuses it. Then as an editor makes it who knows the
formats: rows are sealed anew, the artifact is reopened, and `takt panel run --resume` names it again; seals of runs and hashes of attestations
are computed anew. Those are refused by what contradicts itself, by rows computed anew within three draws of 25 %, or by the signature; what
computing anew finds, the signature finds too. The honest artifact, moved to another folder, passes from its own inputs alone.
Usage: evidence_forgeries_test.py SOURCE_DIR BIN_DIR MAKE_RECORDED_DEMO
"""
import hashlib
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

PANEL = """schema: takt.panel/1
panel: forged
duration: 4 s
seeds: { first: 1, count: SEEDS }
window: { from: 2 s, for: 1 s }
tasks:
  - { task: arm_tracking, robot: config/arm6.yaml, scored: 1 s, bound: 20 mm }
methods:
  - { name: often, description: as the robot file says }
  - { name: seldom, description: every second observation, override: [{ key: policy.period, value: 40 ms }] }
perturbations:
  - { kind: none }
  - { kind: policy_crash }
claims: { conceptual: a command outlives it, systems: how often it answers, evidence: success and error by seed }
"""
RECOMPUTED = "differs: row"  # by rows computed anew
ID = "not the rows, contracts and seed plan that forged-"


def every(change):
    def on_all(rows):
        for row in rows:
            change(row)
    return on_all


def number(path, by):
    def change(row):
        for key in path[:-1]:
            row = row[key]
        row[path[-1]] = by(row[path[-1]])
    return every(change)


def swapped(rows, a, b, key):
    rows[a][key], rows[b][key] = rows[b][key], rows[a][key]


def contradictory_row(row):
    """A success that nothing but its own numbers speaks against."""
    row.update(success=True, failure_label="", fell=False)


def edits_of_rows():
    """(name, function of the list of rows, what refuses the edit once all seals are made anew)."""
    yield "all succeeded", every(contradictory_row), "is a success with .* of error, and panel.yaml's bound is 0.02 m"
    yield "5 m of error", lambda rows: rows[0].update(tracking_error_rms_m=5), "row 1 is a success with 5 m of error"
    yield "ended latched", lambda rows: rows[0]["monitor_state"].update(mode="fault_latched"), "is a success that ended in fault_latched"
    yield "p99 below p50", number(("age_per_tick", "total", "p99_ms"), lambda value: value / 100), "which do not rise"
    yield "500 misses, rate 0", lambda rows: rows[0]["misses_per_tick"].update(misses=500, rate=0), "misses_per_tick.rate is 0"
    yield "shares add up to 3", lambda rows: rows[0]["mode_share"].update(tracking=3 - 0.1), "mode_share.tracking is 2.9"
    yield "one tick", lambda rows: rows[0].update(ticks=1), "of only 1 ticks"
    yield "one tick, no misses", lambda rows: rows[0].update(ticks=1, misses_per_tick={
        "misses": 0, "count": 0, "rate": 0, "effective_count": 0, "upper_bound": 1}), "is a success of 1 ticks, and 4 s have at least 20"
    yield "a part above its whole", lambda rows: rows[0]["age_per_tick"].update(infer={"p50_ms": 900, "p95_ms": 901, "p99_ms": 902}), "more than the total's"
    yield "one hash, two seeds", lambda rows: rows[0].update(replay_hash=rows[1]["replay_hash"]), "has the ticks of row"
    yield "too many ticks", lambda rows: rows[0].update(ticks=10**6), "has 1000000 ticks, and 4 s have at most"
    yield "one failed", lambda rows: rows[0].update(success=False, failure_label="tracking_error"), "failed by an error of"
    yield "a row twice", lambda rows: rows.append(dict(rows[0])), "which row 1 is already"
    yield "a row less", lambda rows: rows.pop(), "panel run: nothing refuses; the row is run again"
    yield "a seed copied", lambda rows: rows[0].update(seed=rows[1]["seed"]), "is rollout|which row"
    yield "a seed that was not planned", lambda rows: rows[0].update(seed=99), "has seed 99, which is not in the seed plan"
    yield "nominal for perturbed", every(lambda row: row.update(perturbation="none", dose=0)), "is already"
    yield "another policy", every(lambda row: row.update(policy_sha256="0" * 64)), "comes from another policy file of its method"
    yield "another plant", every(lambda row: row.update(plant_sha256="0" * 64)), "comes from another plant"
    yield "another configuration", every(lambda row: row.update(config_sha256="0" * 64)), "comes from another configuration of its method"
    yield "a word too many", every(lambda row: row.update(remark="fine")), "remark is not a field of takt.rollout/1"
    yield "a number as text", every(lambda row: row.update(energy_J="3")), "energy_J is \"3\", not"
    yield "an infinite number", every(lambda row: row.update(energy_J=1e999)), "not JSON|is not finite|row 1: "
    yield "fewer effective trials", number(("misses_per_tick", "effective_count"), lambda value: value * 2), "misses_per_tick.effective_count is"
    yield "a smaller bound", number(("misses_per_tick", "upper_bound"), lambda value: value / 2), "upper_bound"
    yield "another rate", number(("misses_per_command", "rate"), lambda value: value / 2 + 0.01), "misses_per_command.rate is"
    yield "seeds exchanged", lambda rows: [swapped(rows, 2 * i, 2 * i + 1, "replay_hash") for i in range(len(rows) // 2)], RECOMPUTED
    yield "other hashes", every(lambda row: row.update(replay_hash=hashlib.sha256(row["replay_hash"].encode()).hexdigest()[:16])), RECOMPUTED
    yield "another label", every(lambda row: row["success"] or row.update(failure_label="operator_stop")), RECOMPUTED
    for name, path, by in (("younger", ("age_per_tick", "sense", "p50_ms"), lambda value: value / 2),
                           ("shorter queues", ("age_per_command", "queue", "p50_ms"), lambda value: value / 2),
                           ("less energy", ("energy_J",), lambda value: value / 2), ("less torque", ("peak_torque_Nm",), lambda value: value / 2),
                           ("calmer", ("torque_rate_Nm_s",), lambda value: value / 3), ("smoother", ("peak_reference_jerk",), lambda value: value / 3),
                           ("closer", ("tracking_error_rms_m",), lambda value: value / 1.5), ("closer at worst", ("tracking_error_p95_m",), lambda value: value / 3),
                           ("faster inference", ("inference_mean_ms",), lambda value: value / 2),
                           ("smoother joins", ("peak_join_velocity_step",), lambda value: value / 2 + 0.01)):
        yield name, number(path, by), RECOMPUTED


def edits_of_manifest():
    """(name, function of the manifest, sentence that refuses it)."""
    def of(**values):
        return lambda manifest: manifest.update(values)
    yield "timing", of(timing="real"), ID
    yield "fewer planned", of(planned_rollouts=3), "says that it is complete, and holds"
    yield "unfinished", of(complete=False), "says that it is unfinished, and seal.json that it was finished"
    yield "another id", of(artifact_id="forged-000000000000"), ID
    yield "merged from another", of(merged_from=["another"]), "manifest.json is not the file that was sealed"
    yield "another row schema", of(row_schema_sha256="0" * 64), "was written with another row schema"
    yield "another host", of(host={"preempt_rt": True}), "manifest.json is not the file that was sealed"
    yield "a looser contract", lambda m: m["methods"]["often"]["tasks"]["arm_tracking"]["metric_contract"].update(max_age_ms=500), ID
    yield "another script", lambda m: m["script"].update(source_sha256="0" * 64), "comes from another script"
    yield "another plant", lambda m: m["plants"].update(arm_tracking="0" * 64), "comes from another plant"
    yield "a method less", lambda m: m["methods"].pop("seldom"), "has method seldom, which is not in the manifest"
    yield "a seed less", lambda m: m["seed_plan"]["seeds"].pop(), "which is not in the seed plan"
    yield "another day", lambda m: m["started"].update(unix_ns=1), "manifest.json is not the file that was sealed"
    yield "other claims", lambda m: m["claims"].update(evidence="everything is better"), "manifest.json is not the file that was sealed"
    yield "a key too many", of(note=1), "manifest.note is unknown"


def edits_of_files():
    """(name, function of the folder, sentence that refuses it)."""
    for file in ("panel.yaml", "rollout.schema.json", "rollouts.sha256", "rollouts.parquet", "confusion.json", "seal.json", "inputs.json"):
        def longer(folder, file=file):
            (folder / file).write_bytes((folder / file).read_bytes() + b" ")
        sentence = {"rollout.schema.json": "not the row schema", "rollouts.sha256": "has seals of rows that are not there",
                    "seal.json": "seal.json is not as it was written"}.get(file, f"{file} is not the file that was sealed")
        yield f"{file} is gone", lambda folder, file=file: (folder / file).unlink(), f"{file}|not as it was written"
        yield f"{file} has a byte more", longer, sentence
    yield "an empty schema", lambda folder: (folder / "rollout.schema.json").write_text("{}"), "not the row schema that manifest.json names"
    yield "bytes behind a NUL", lambda folder: (folder / "manifest.json").write_bytes((folder / "manifest.json").read_bytes() + b"\0{}"), "NUL byte"
    yield "another policy kept", lambda folder: largest(folder / "inputs").write_bytes(b"another"), "is not what was kept"
    yield "no policy kept", lambda folder: largest(folder / "inputs").unlink(), "is not there"
    yield "a post-mortem of one line", lambda folder: [file.write_text("completed-by: x\n") for file in (folder / "postmortems").iterdir()], \
        "has a name and no conclusion"
    yield "no post-mortem", lambda folder: shutil.rmtree(folder / "postmortems"), "does not exist"


def largest(folder):
    return max(folder.iterdir(), key=lambda file: file.stat().st_size)


def edits_of_runs():
    """(name, function of the run folder, sentence that refuses it)."""
    def text(name, change):
        return lambda folder: (folder / name).write_text(change((folder / name).read_text()))

    def less(name, share):
        return lambda folder: (folder / name).write_bytes((folder / name).read_bytes()[:int(len((folder / name).read_bytes()) * share)])

    def manifest(change):
        def edit(folder):
            said = json.loads((folder / "manifest.json").read_text())
            change(said)
            (folder / "manifest.json").write_text(json.dumps(said, indent=2))
        return edit

    for file in ("ticks.mcap", "can.log.zst", "transitions.jsonl"):
        if file != "ticks.mcap":
            yield f"{file} is gone", lambda folder, file=file: (folder / file).unlink(), f"{file} is not there"
        yield f"{file} is cut", less(file, 0.5), f"{file} is not as it was recorded from its beginning to"
        yield f"{file} has bytes more", lambda folder, file=file: (folder / file).write_bytes((folder / file).read_bytes() + b"\n"), \
            f"{file} has 1 bytes that were not recorded"
    yield "the stop is gone", text("transitions.jsonl", lambda said: "".join(line for line in said.splitlines(True) if "damped_stop" not in line)), \
        "transitions.jsonl is not as it was recorded"
    yield "a frame", lambda folder: flip(folder / "can.log.zst", 0.6), "can.log.zst is not as it was recorded"
    yield "a byte of the ticks", lambda folder: flip(folder / "ticks.mcap", 0.6), "ticks.mcap"
    yield "another robot file", text("config.yaml", lambda said: said + "# longer arms\n"), "config.yaml"
    yield "another host", manifest(lambda said: said["host"].update(preempt_rt=True, cpu="faster")), "manifest.json is not the file that was recorded"
    yield "another day", manifest(lambda said: said["started"].update(utc="2020-01-01T00:00:00Z")), "manifest.json is not the file that was recorded"
    yield "ended otherwise", manifest(lambda said: said.update(ended_because="the task was done")), "manifest.json is not the file that was recorded"
    yield "other cautions", manifest(lambda said: said.update(cautions=[])), "manifest.json is not the file that was recorded|nothing changed"
    yield "no seal", lambda folder: (folder / "seal.json").unlink(), "it has no seal.json"
    yield "another seal", text("seal.json", lambda said: said.replace("\"closed\": true", "\"closed\": false")), "ended before it closed the run"
    yield "a seal without segments", text("seal.json", lambda said: json.dumps({**json.loads(said), "segments": {}})), "seal.json is no seal of this version"


def flip(file, place):
    data = bytearray(file.read_bytes())
    data[int(len(data) * place)] ^= 16
    file.write_bytes(bytes(data))


class Forgery:
    def __init__(self, source, programs, make_recorded_demo, made):
        self.takt, self.source, self.made = programs / "takt", source, made
        self.honest, self.panel = made / "honest", made / "forged.yaml"
        self.panel.write_text(PANEL.replace("SEEDS", "6").replace("config/arm6.yaml", str(source / "config/arm6.yaml")))
        self.private, self.public = made / "lab.pem", made / "lab.pub"
        for words in (("genpkey", "-algorithm", "ed25519", "-out", self.private), ("pkey", "-in", self.private, "-pubout", "-out", self.public)):
            subprocess.run(["openssl", *map(str, words)], check=True, capture_output=True)
        self.call("panel", "run", self.panel, "--out", self.honest, "--workers", "2", expect=0)
        for file in (self.honest / "postmortems").iterdir():
            file.write_text(file.read_text().replace("\ncompleted-by:", "The policy died, and the arm stopped.\n\ncompleted-by: A. Tester"))
        self.call("seal", self.honest, "--key", self.private, expect=0)
        subprocess.run([make_recorded_demo, made / "demo"], check=True, capture_output=True, cwd=source)
        self.run = next(path.parent for path in sorted((made / "demo").rglob("seal.json")))
        self.call("seal", self.run, "--key", self.private, expect=0)
        self.wrong, self.planted = [], 0

    def call(self, *words, expect=None):
        done = subprocess.run([self.takt, *map(str, words)], cwd=self.source, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300)
        if expect is not None and done.returncode != expect:
            raise SystemExit(f"{words}: {done.returncode}\n{done.stdout[-3000:]}")
        return done

    def copy(self, of):
        folder = self.made / "copy"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(of, folder)
        return folder

    def judge(self, name, said, sentence, code=1):
        """One edit was refused, and by its sentence?"""
        self.planted += 1
        line = next((line.strip() for line in said.stdout.splitlines() if re.search(sentence, line)), None)
        if said.returncode != code or line is None:
            self.wrong.append(f"{name}: exit code {said.returncode}, expected '{sentence}': {said.stdout[-700:]}")
        else:
            print(f"{name}: {line[:140]}", flush=True)

    def by_signature(self, name, folder):
        done = self.call("audit", folder, "--signed-by", self.public)
        if done.returncode != 1 or "seal.json is not the file that was signed" not in done.stdout:
            self.wrong.append(f"{name}: the signature does not find it: {done.stdout[-300:]}")

    def computed_anew(self, folder):
        """The first of three draws that finds it, or the last."""
        for _ in range(3):
            done = self.call("audit", folder, "--recompute", "25%", "--workers", "2")
            if RECOMPUTED in done.stdout:
                break
        return done

    @staticmethod
    def seal_rows(folder):
        before, seals = "", ""
        for line in (folder / "rollouts.jsonl").read_text().splitlines(True):
            before = hashlib.sha256((before + "\n" + line).encode()).hexdigest()
            seals += before + "\n"
        (folder / "rollouts.sha256").write_text(seals)

    def launder(self, folder):
        """As an editor does it who knows the format: new seals, reopened, and finished by Takt itself."""
        self.seal_rows(folder)
        (folder / "seal.json").unlink()
        manifest = json.loads((folder / "manifest.json").read_text())
        manifest.update(complete=False, artifact_id="")
        (folder / "manifest.json").write_text(json.dumps(manifest))
        return self.call("panel", "run", self.panel, "--out", folder, "--resume")

    def plant_in_rows(self):
        honest = (self.honest / "rollouts.jsonl").read_text()
        for name, change, sentence in edits_of_rows():
            rows = [json.loads(line) for line in honest.splitlines()]
            change(rows)
            text = "".join(json.dumps(row, separators=(",", ":")) + "\n" for row in rows)
            if text == "".join(json.dumps(json.loads(line), separators=(",", ":")) + "\n" for line in honest.splitlines()):
                self.wrong.append(f"{name}: changes nothing")
            folder = self.copy(self.honest)
            (folder / "rollouts.jsonl").write_text(text)
            self.judge(f"rows: {name}", self.call("audit", folder), f"{ID}|row \\d+|holds .* of 24 planned|not JSON")
            resumed = self.launder(folder)
            if resumed.returncode != 0:
                self.judge(f"sealed anew: {name}", resumed, sentence)
            elif sentence.startswith("panel run:"):
                if "24 rollouts, 1 of them now" not in resumed.stdout:
                    self.wrong.append(f"{name}: {resumed.stdout[-300:]}")
            elif sentence == RECOMPUTED:
                self.judge(f"sealed anew: {name}", self.computed_anew(folder), RECOMPUTED)
                self.by_signature(name, folder)
            else:
                self.judge(f"sealed anew: {name}", self.call("audit", folder), sentence)
                self.by_signature(name, folder)

    def plant_in_artifact(self):
        for name, change, sentence in edits_of_manifest():
            folder = self.copy(self.honest)
            manifest = json.loads((folder / "manifest.json").read_text())
            change(manifest)
            (folder / "manifest.json").write_text(json.dumps(manifest, indent=2) + "\n")
            self.judge(f"manifest: {name}", self.call("audit", folder), sentence)
        for name, change, sentence in edits_of_files():
            folder = self.copy(self.honest)
            change(folder)
            self.judge(f"files: {name}", self.call("audit", folder), sentence)

    def plant_in_run(self):
        for name, change, sentence in edits_of_runs():
            folder = self.copy(self.run)
            change(folder)
            self.judge(f"run: {name}", self.call("audit", folder), sentence)
            if "seal" in name:
                continue  # nothing else was edited
            self.seal_run(folder)
            done = self.call("audit", folder, "--signed-by", self.public)
            if done.returncode == 0:
                self.wrong.append(f"run: {name}: sealed anew it passes for the signed one")

    @staticmethod
    def seal_run(folder):
        seal = json.loads((folder / "seal.json").read_text())
        seal["closed"] = True
        for name in seal["files"]:
            if (folder / name).exists():
                seal["files"][name] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
        for name, segments in seal["segments"].items():
            data = (folder / name).read_bytes() if (folder / name).exists() else b""
            until = segments[-1]["until_unix_ns"] if segments else 1
            seal["segments"][name] = [{"bytes": len(data), "until_unix_ns": until, "sha256": hashlib.sha256(data).hexdigest()}] if data else []
        (folder / "seal.json").write_text(json.dumps(seal, indent=2) + "\n")

    def plant_in_attestation(self):
        """Of the balancer's stop: alone each edit is no attestation; with its hash made anew it shows too little, or is believed, and found by trials."""
        honest = json.loads((self.source / "config/shown/balancer.operator_stop.json").read_text())
        trials = honest["conditions"][0]["trials"]

        def fewer(said):
            said["conditions"][0]["trials"] = trials[:20]
            said["says"] = "20 of 20 stood under operator_stop 1: at least 0.86 at 95 % confidence"

        edits = (("of another stop", lambda said: said.update(of="stops.overrun"), "it is of stops.overrun"),
                 ("of another robot", lambda said: said.update(moving_parts_sha256="0" * 64), "this robot has changed since"),
                 ("of another version", lambda said: said["script"].update(version="9.9.9"), "takt 9.9.9 computed it"),
                 ("a late fall", lambda said: said.update(fell_below=0.1), "called a robot fallen below 0.1"),
                 ("fewer trials", fewer, "0.9 is asked"),
                 ("a short look", lambda said: trials_of(said)[0].update(seconds=1.0), "it was watched for 1 s"),
                 ("a trial twice", lambda said: trials_of(said)[1].update(seed=1), "a trial is in it twice"),
                 ("another panel", lambda said: said.update(panel_text=said["panel_text"].replace("duration: ", "duration: 1")), "is not as it was written"),
                 ("a better word", lambda said: said.update(says="30 of 30 stood: for ever"), "is not as it was written"))
        robot = self.made / "robot"
        robot.mkdir()
        for file in (self.source / "config").glob("balancer.*"):
            shutil.copy(file, robot)
        shutil.copytree(self.source / "config/shown", robot / "shown")
        shown = robot / "shown/balancer.operator_stop.json"
        if self.call("config", "check", robot / "balancer.yaml").returncode != 0:
            raise SystemExit("the honest balancer does not stand")
        for name, change, sentence in edits:
            said = json.loads(json.dumps(honest))
            change(said)
            shown.write_text(json.dumps(said))
            self.judge(f"attestation: {name}", self.call("audit", shown), "is not as it was written")
            self.hash_anew(said)
            shown.write_text(json.dumps(said))
            done = self.call("config", "check", robot / "balancer.yaml")
            self.judge(f"attestation, hashed anew: {name}", done, sentence, done.returncode)
        self.compute_attestation_anew(robot, shown, honest)

    def compute_attestation_anew(self, robot, shown, honest):
        """What only its rollouts can tell: `takt config check --recompute`, of this one attestation."""
        alone = robot / "balancer.yaml"
        alone.write_text(re.sub(r"(shown_by: )(?!shown/balancer.operator_stop.json)[^ ,}\n]+", r"\1none", alone.read_text()))
        shown.write_text(json.dumps(honest))
        done = self.call("config", "check", alone, "--recompute", "5%")
        if done.returncode != 0 or "6 of 120 rollouts computed anew" not in done.stdout:
            raise SystemExit(f"the honest attestation does not come out again: {done.stdout[-2000:]}")
        for name, change, sentence in (("other ticks", lambda trial: trial.update(replay_hash=trial["replay_hash"][::-1]), r"has other ticks than are said"),
                                       ("another row", lambda trial: trial.update(row_sha256=trial["row_sha256"][::-1]), r"has another row than is said")):
            said = json.loads(json.dumps(honest))
            for trial in trials_of(said):
                change(trial)
            self.hash_anew(said)
            shown.write_text(json.dumps(said))
            self.call("config", "check", alone, expect=0)
            self.judge(f"attestation, computed anew: {name}", self.call("config", "check", alone, "--recompute", "25%"), sentence, 65)

    @staticmethod
    def hash_anew(said):
        said.pop("sha256")
        said["sha256"] = hashlib.sha256(json.dumps(said, separators=(",", ":"), ensure_ascii=False).encode()).hexdigest()


def trials_of(said):
    return said["conditions"][0]["trials"]


# Threat: artifact-edited
def main():
    source, programs, make_recorded_demo = (pathlib.Path(argument).resolve() for argument in sys.argv[1:4])
    with tempfile.TemporaryDirectory(prefix="takt-forged.") as made:
        forgery = Forgery(source, programs, make_recorded_demo, pathlib.Path(made))
        honest = forgery.call("audit", forgery.copy(forgery.honest), "--recompute", "25%", "--signed-by", forgery.public)
        if honest.returncode != 0 or not honest.stdout.endswith("\naudit-ready\n") or "; 6 of 24 rows computed anew; signed by" not in honest.stdout:
            raise SystemExit(f"the honest artifact is not audit-ready: {honest.stdout[-2000:]}")
        if not forgery.call("audit", forgery.run, "--signed-by", forgery.public, expect=0).stdout.endswith("\naudit-ready\n"):
            raise SystemExit("the honest run is not audit-ready")
        forgery.plant_in_rows()
        forgery.plant_in_artifact()
        forgery.plant_in_run()
        forgery.plant_in_attestation()
    print(f"{forgery.planted} planted edits, {len(forgery.wrong)} not refused by their sentence")
    for each in forgery.wrong:
        print(f"WRONG: {each}")
    return 1 if forgery.wrong or forgery.planted < 60 else 0


if __name__ == "__main__":
    sys.exit(main())
