#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: what the tools of docs/neighbours.md keep of an artifact and of a run folder is as good as the original. Method: the page's own files run the page's
panel; stand-ins for the tools keep files as those do on disk (DVC's cache by MD5 with a list of paths, MLflow's run folder, a W&B artifact's version), without
owners, times and empty folders; from each the folder is taken back, and `takt audit` and verify_seal.py must say of it what they say of the original. A run of
`takt run` goes the same way. A byte that one of them alters is found. The tools themselves are not in Debian.
Usage: neighbours_page.py REPOSITORY BIN
"""
import contextlib
import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import types

import yaml

ROOT, BIN = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()


def files_of(folder):
    return sorted(path for path in folder.rglob("*") if path.is_file())


def copied(folder, to):
    """Each file under its path, and nothing else."""
    for path in files_of(folder):
        place = to / path.relative_to(folder)
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_bytes(path.read_bytes())
    return to


def through_dvc(folder, place):
    """Contents under files/md5/ab/cdef..., and a list of paths with their hashes; then checked out."""
    cache, listed = place / "files/md5", []
    for path in files_of(folder):
        data = path.read_bytes()
        md5 = hashlib.md5(data).hexdigest()
        (cache / md5[:2]).mkdir(parents=True, exist_ok=True)
        (cache / md5[:2] / md5[2:]).write_bytes(data)
        listed.append({"md5": md5, "relpath": path.relative_to(folder).as_posix()})
    listing = json.loads(json.dumps(sorted(listed, key=lambda one: one["relpath"])))
    out = place / "checked_out"
    for one in listing:
        (out / one["relpath"]).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(cache / one["md5"][:2] / one["md5"][2:], out / one["relpath"])
    return out


def fake_mlflow(place):
    """A run's folder: params/KEY, metrics/KEY with lines of time, value and step, artifacts/."""
    run = place / "mlruns/0/run"

    def log_params(params):
        for key, value in params.items():
            assert re.fullmatch(r"[\w\-./ ]{1,250}", key) and len(str(value)) <= 6000, key
            (run / "params").mkdir(parents=True, exist_ok=True)
            (run / "params" / key).write_text(str(value))

    def log_metrics(metrics):
        for key, value in metrics.items():
            assert re.fullmatch(r"[\w\-./ ]{1,250}", key) and isinstance(float(value), float), key
            (run / "metrics").mkdir(parents=True, exist_ok=True)
            (run / "metrics" / key).write_text(f"0 {value} 0\n")

    return run, types.SimpleNamespace(start_run=lambda run_name: contextlib.nullcontext(), log_params=log_params, log_metrics=log_metrics,
                                      log_artifacts=lambda local, path: copied(pathlib.Path(local), run / "artifacts" / path))


def fake_wandb(place):
    """artifacts/NAME:v0/."""

    class Artifact:
        def __init__(self, name, type, metadata):
            assert re.fullmatch(r"[\w\-.]{1,128}", name), f"{name} cannot be the name of an artifact"
            json.dumps(metadata)
            self.folder = place / "artifacts" / f"{name}:v0"

        def add_dir(self, local):
            copied(pathlib.Path(local), self.folder)

    run = types.SimpleNamespace(log=lambda values: json.dumps(values), log_artifact=lambda artifact: None)
    return types.SimpleNamespace(init=lambda project: contextlib.nullcontext(run), Artifact=Artifact)


def verdicts(folder):
    """What audit and verifier say; the folder's own name is no part of it."""
    said = []
    for words in ([BIN / "takt", "audit", folder], [sys.executable, ROOT / "lab/artifact/verify_seal.py", folder]):
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        said.append((done.returncode, (done.stdout + done.stderr).replace(str(folder), "DIR")))
    return said


def same(folder, copy, of):
    whole, kept = verdicts(folder), verdicts(copy)
    assert whole == kept, f"{of}: {kept} instead of {whole}"
    assert [path.relative_to(copy) for path in files_of(copy)] == [path.relative_to(folder) for path in files_of(folder)], of
    victim = max((path for path in files_of(copy) if path.name in ("rollouts.jsonl", "ticks.mcap")), key=lambda path: path.stat().st_size)
    data = bytearray(victim.read_bytes())
    data[len(data) // 2] ^= 1
    victim.write_bytes(data)
    altered = verdicts(copy)
    assert all(code != 0 and code != good for (code, _), (good, _) in zip(altered[1:], whole[1:])) and altered[0] != whole[0], f"{of}: an altered byte: {altered}"


def main():
    page = (ROOT / "docs/neighbours.md").read_text()
    with tempfile.TemporaryDirectory() as scratch:
        place = pathlib.Path(scratch)
        work = place / "work"
        work.mkdir()
        (work / "config").symlink_to(ROOT / "config")
        os.chdir(work)
        os.environ["PATH"] = f"{BIN}:{os.environ['PATH']}"
        written = re.findall(r"```\w+ (\S+)\n(.*?)```", page, re.S)
        for name, text in written:
            pathlib.Path(name).write_text(text)
        stage = yaml.safe_load(pathlib.Path("dvc.yaml").read_text())["stages"]["panel"]
        assert stage.keys() == {"cmd", "deps", "outs", "metrics"} and all(pathlib.Path(one).is_file() for one in stage["deps"]), stage
        subprocess.run(stage["cmd"], shell=True, check=True, stdout=subprocess.DEVNULL)
        assert all(pathlib.Path(one).exists() for one in [*stage["outs"], *(key for one in stage["metrics"] for key in one)])
        inputs = json.loads(pathlib.Path("artifact/inputs.json").read_text())
        needed = {pathlib.Path(one).name for one in stage["deps"]}
        assert {"arm6_reach.onnx"} <= needed, inputs
        artifact = work / "artifact"
        same(artifact, through_dvc(artifact, place / "dvc"), "DVC")
        run, mlflow = fake_mlflow(place)
        sys.modules["mlflow"], sys.modules["wandb"] = mlflow, fake_wandb(place)
        blocks = dict(written)
        exec(compile(blocks["with_mlflow.py"], "with_mlflow.py", "exec"), {})
        assert {path.name for path in (run / "metrics").iterdir()} == {"takt_none", "takt_inference_stall"}
        same(artifact, run / "artifacts/takt", "MLflow")
        exec(compile(blocks["with_wandb.py"], "with_wandb.py", "exec"), {})
        same(artifact, next((place / "artifacts").iterdir()), "W&B")
        subprocess.run(["takt", "run", "config/arm6.yaml", "--allow-non-realtime", "--duration", "2s", "--run-dir", place / "run", "--runtime-dir", place / "sockets"],
                       check=True, capture_output=True)
        same(place / "run", through_dvc(place / "run", place / "dvc_of_run"), "DVC, a run")
        same(place / "run", copied(place / "run", place / "mlflow_of_run"), "MLflow, a run")
    return 0


if __name__ == "__main__":
    sys.exit(main())
