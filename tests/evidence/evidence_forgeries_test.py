#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: no edit of a finished artifact passes for the artifact. Method: a small panel in virtual time; edits of its rows, manifest and files, each in
a copy of its own, judged by `takt audit`. First edits alone: refused, or an item is missing. Then edits by somebody who knows the format: the seals
of the rows are made anew, the artifact is reopened, and `takt panel run --resume` names it again. Those are consistent, and never audit-ready: rows
computed anew come out otherwise. The honest artifact passes.
Usage: evidence_forgeries_test.py SOURCE_DIR BIN_DIR
"""
import hashlib
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

PANEL = """schema: takt.panel/1
panel: forged
duration: 4 s
seeds: { first: 1, count: 3 }
window: { from: 2 s, for: 1 s }
tasks:
  - { task: arm_tracking, robot: config/arm6.yaml, scored: 1 s, bound: 20 mm }
methods:
  - { name: often, description: as the robot file says }
  - { name: seldom, description: every second observation, override: [{ key: policy.period, value: 40 ms }] }
perturbations:
  - { kind: none }
  - { kind: policy_crash }
claims: { conceptual: a, systems: b, evidence: c }
"""


def edits_of_rows():
    """(name, function of the list of rows), each an edit that changes what the rows say."""
    def of(name, change):
        return name, change

    def number(path, by):
        def change(rows):
            place = rows[0]
            for key in path[:-1]:
                place = place[key]
            place[path[-1]] = by(place[path[-1]])
        return of(".".join(path), change)

    yield of("all succeeded", lambda rows: [row.update(success=True, failure_label="") for row in rows])
    yield of("one failed", lambda rows: rows[0].update(success=False, failure_label="command_lost"))
    yield of("another label", lambda rows: rows[0].update(failure_label="operator_stop", success=False))
    yield of("a replay hash", lambda rows: rows[0].update(replay_hash="deadbeef"))
    yield of("two hashes exchanged", lambda rows: rows[0].update(replay_hash=rows[1]["replay_hash"]) or None)
    yield of("a row twice", lambda rows: rows.append(dict(rows[0])))
    yield of("a row less", lambda rows: rows.pop())
    yield of("rows in another order", lambda rows: rows.reverse())
    yield of("a seed copied", lambda rows: rows[0].update(seed=rows[1]["seed"]))
    yield of("a seed that was not planned", lambda rows: rows[0].update(seed=99))
    yield of("methods exchanged", lambda rows: [row.update(method={"often": "seldom", "seldom": "often"}[row["method"]]) for row in rows])
    yield of("nominal for perturbed", lambda rows: [row.update(perturbation="none", dose=0) for row in rows])
    for part in ("sense", "queue", "infer", "publish", "total"):
        for quantile in ("p50_ms", "p95_ms", "p99_ms"):
            yield number(("age_per_tick", part, quantile), lambda value: value / 2)
    for part in ("total", "infer"):
        yield number(("age_per_command", part, "p99_ms"), lambda value: value * 2)
    for kind in ("misses_per_command", "misses_per_tick"):
        yield number((kind, "misses"), lambda value: value + 7)
        yield number((kind, "rate"), lambda value: value + 0.01)
        yield number((kind, "upper_bound"), lambda value: value / 2)
        yield number((kind, "effective_count"), lambda value: value * 2)
        yield number((kind, "count"), lambda value: value + 1000)
    for mode in ("tracking", "degraded"):
        yield number(("mode_share", mode), lambda value: value + 0.5 if value < 0.5 else value - 0.4)
    for key in ("energy_J", "peak_torque_Nm", "torque_rate_Nm_s", "peak_reference_jerk", "tracking_error_rms_m", "tracking_error_p95_m"):
        yield number((key,), lambda value: value / 3)
    yield number(("ticks",), lambda value: 1)


def edits_of_manifest():
    for key, value in (("timing", "real"), ("planned_rollouts", 3), ("complete", False), ("artifact_id", "forged-000000000000"),
                       ("merged_from", ["another"]), ("row_schema_sha256", "0" * 64), ("host", {"preempt_rt": True})):
        yield key, lambda manifest, key=key, value=value: manifest.update({key: value})
    yield "a looser contract", lambda manifest: manifest["methods"]["often"]["tasks"]["arm_tracking"]["metric_contract"].update(max_age_ms=500)
    yield "another script", lambda manifest: manifest["script"].update(source_sha256="0" * 64)
    yield "another plant", lambda manifest: manifest["plants"].update(arm_tracking="0" * 64)
    yield "a method less", lambda manifest: manifest["methods"].pop("seldom")
    yield "another day", lambda manifest: manifest["started"].update(unix_ns=1)
    yield "other claims", lambda manifest: manifest["claims"].update(evidence="everything")


def edits_of_files():
    for file in ("panel.yaml", "rollout.schema.json", "rollouts.sha256", "rollouts.parquet", "confusion.json", "seal.json"):
        yield f"{file} is gone", lambda folder, file=file: (folder / file).unlink()
        yield f"{file} has a byte more", lambda folder, file=file: (folder / file).write_bytes((folder / file).read_bytes() + b" ")
    yield "an empty schema", lambda folder: (folder / "rollout.schema.json").write_text("{}")
    yield "bytes behind a NUL", lambda folder: (folder / "manifest.json").write_bytes((folder / "manifest.json").read_bytes() + b"\0{}")


class Forgery:
    def __init__(self, takt, source, made):
        self.takt, self.source, self.made = takt, source, made
        self.honest, self.panel = made / "honest", made / "forged.yaml"
        self.panel.write_text(PANEL.replace("config/arm6.yaml", str(source / "config/arm6.yaml")))
        self.call("panel", "run", self.panel, "--out", self.honest, "--workers", "2", expect=0)
        self.wrong = []

    def call(self, *words, expect=None):
        done = subprocess.run([self.takt, *words], cwd=self.source, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300)
        if expect is not None and done.returncode != expect:
            raise SystemExit(f"{words}: {done.returncode}\n{done.stdout[-3000:]}")
        return done

    def copy(self):
        folder = self.made / "copy"
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(self.honest, folder)
        return folder

    @staticmethod
    def rows(folder):
        return [json.loads(line) for line in (folder / "rollouts.jsonl").read_text().splitlines()]

    @staticmethod
    def write_rows(folder, rows):
        (folder / "rollouts.jsonl").write_text("".join(json.dumps(row, separators=(",", ":")) + "\n" for row in rows))

    def audit(self, folder, *words):
        return self.call("audit", folder, *words)

    def must_be_refused(self, name, folder):
        done = self.audit(folder)
        if done.returncode == 0:
            self.wrong.append(f"{name}: passes")
        elif done.returncode != 1:
            self.wrong.append(f"{name}: exit code {done.returncode}: {done.stdout[-300:]}")
        else:
            print(f"{name}: {done.stdout.strip().splitlines()[0 if done.stdout.startswith('takt audit') else -2].strip()[:150]}")

    def launder(self, folder):
        """As somebody does it who knows the format: new seals, reopened, and finished by Takt itself."""
        before, seals = "", ""
        for line in (folder / "rollouts.jsonl").read_text().splitlines(True):
            before = hashlib.sha256((before + "\n" + line).encode()).hexdigest()
            seals += before + "\n"
        (folder / "rollouts.sha256").write_text(seals)
        (folder / "seal.json").unlink()
        manifest = json.loads((folder / "manifest.json").read_text())
        manifest.update(complete=False, artifact_id="")
        (folder / "manifest.json").write_text(json.dumps(manifest))
        return self.call("panel", "run", self.panel, "--out", folder, "--resume")


def main():
    source, programs = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    with tempfile.TemporaryDirectory(prefix="takt-forged.") as made:
        forgery = Forgery(programs / "takt", source, pathlib.Path(made))
        honest = forgery.audit(forgery.honest, "--recompute", "25%", "--panel", forgery.panel)
        if not honest.stdout.endswith("audit-ready\n"):
            raise SystemExit(f"the honest artifact is not audit-ready: {honest.stdout[-2000:]}")
        planted = 0
        for name, change in edits_of_rows():
            folder = forgery.copy()
            rows = forgery.rows(folder)
            change(rows)
            forgery.write_rows(folder, rows)
            forgery.must_be_refused(f"rows: {name}", folder)
            planted += 1
        for name, change in edits_of_manifest():
            folder = forgery.copy()
            manifest = json.loads((folder / "manifest.json").read_text())
            change(manifest)
            (folder / "manifest.json").write_text(json.dumps(manifest, indent=2))
            forgery.must_be_refused(f"manifest: {name}", folder)
            planted += 1
        for name, change in edits_of_files():
            folder = forgery.copy()
            change(folder)
            forgery.must_be_refused(f"files: {name}", folder)
            planted += 1
        laundered = {
            "better errors": lambda row: row.update(tracking_error_rms_m=row["tracking_error_rms_m"] / 3),
            "less energy": lambda row: row.update(energy_J=row["energy_J"] / 2),
            "other hashes": lambda row: row.update(replay_hash=hashlib.sha256(row["replay_hash"].encode()).hexdigest()),
            "fewer marks": lambda row: row.update(peak_reference_jerk=row["peak_reference_jerk"] / 2),
        }
        for name, change in laundered.items():
            folder = forgery.copy()
            rows = forgery.rows(folder)
            for row in rows:
                change(row)
            forgery.write_rows(folder, rows)
            resumed = forgery.launder(folder)
            if resumed.returncode != 0:
                print(f"laundered, {name}: refused by --resume")
                continue
            plain, again = forgery.audit(folder), forgery.audit(folder, "--recompute", "25%", "--panel", forgery.panel)
            if plain.stdout.endswith("\naudit-ready\n") or again.returncode != 1 or "differs: row" not in again.stdout:
                forgery.wrong.append(f"laundered, {name}: {plain.stdout.splitlines()[-1]} / {again.stdout[-500:]}")
            else:
                print(f"laundered, {name}: {[line for line in again.stdout.splitlines() if 'differs' in line][0].strip()[:150]}")
            planted += 1
    print(f"{planted} planted edits, {len(forgery.wrong)} passed")
    for each in forgery.wrong:
        print(f"WRONG: {each}")
    return 1 if forgery.wrong or planted < 60 else 0


if __name__ == "__main__":
    sys.exit(main())
