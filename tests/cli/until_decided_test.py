#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: `takt panel run --until-decided A,B` ends with the seed that decides, gives the same artifact after a SIGKILL, and no later command takes its rows for
those of a panel whose size was chosen before. Method: a cart and pole by the last command for ever (`blind`) loses to Takt at every seed, so that seven of fifty
seeds decide.
Usage: until_decided_test.py SOURCE_DIR BIN_DIR. Exit codes: 0 fine, 1 not.
"""
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

SOURCE, BIN = map(pathlib.Path, sys.argv[1:3])
TAKT = BIN / "takt"
PANEL = ["panel", "run", SOURCE / "config/panels/headline.yaml", "--robot", SOURCE / "config/cart_pole.yaml", "--workers", "2"]


def takt(*arguments):
    return subprocess.run([TAKT, *map(str, arguments)], capture_output=True, text=True, timeout=500, check=False)


def run(folder, rivals="blind,takt", *more):
    return takt(*PANEL, "--until-decided", rivals, "--out", folder, "--json", *more)


def expect(what, condition, detail=""):
    if not condition:
        raise SystemExit(f"{what}: {detail}")


def kill_after_some_rows(folder):
    process = subprocess.Popen([TAKT, *map(str, PANEL), "--until-decided", "blind,takt", "--out", str(folder)],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
    rows = folder / "rollouts.jsonl"
    while process.poll() is None and (not rows.exists() or rows.read_bytes().count(b"\n") < 30):
        time.sleep(0.01)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def main():
    with tempfile.TemporaryDirectory() as folder:
        whole, part = pathlib.Path(folder, "whole"), pathlib.Path(folder, "part")
        ended = run(whole)
        expect("the panel runs", ended.returncode == 0, ended.stderr)
        summary = json.loads(ended.stdout)
        expect("seven seeds decide", summary["until_decided"] | {"evidence": 0} == {"decided": True, "seeds": 7, "evidence": 0}, summary)
        expect("13 conditions, 2 methods, 7 seeds", summary["rollouts"] == 13 * 2 * 7, summary)
        manifest = json.loads((whole / "manifest.json").read_text())
        expect("the manifest says how it ended", manifest["until_decided"] == ["blind", "takt"] and manifest["seed_plan"]["seeds"] == list(range(1, 8)), manifest)

        kill_after_some_rows(part)
        expect("it was killed", not json.loads((part / "manifest.json").read_text())["complete"])
        other = run(part, "takt,blind", "--resume")
        expect("another question is refused", other.returncode == 1 and "--until-decided differs" in other.stderr, other.stderr)
        ended = run(part, "blind,takt", "--resume")
        expect("it is resumed", ended.returncode == 0, ended.stderr)
        again = json.loads((part / "manifest.json").read_text())
        expect("the same artifact", again["artifact_id"] == manifest["artifact_id"], again["artifact_id"])

        compared = takt("compare", whole, "--method-a", "blind", "--method-b", "takt")
        expect("a comparison notes it", "A ends when success is decided" in compared.stdout, compared.stdout)
        merged = takt("panel", "merge", pathlib.Path(folder, "merged"), whole)
        expect("a merge would lose it", merged.returncode == 1 and "it stands alone" in merged.stderr, merged.stderr)
        for rivals, why in [("takt", "write two methods"), ("takt,takt", "two different methods"), ("takt,nobody", "no method nobody")]:
            refused = run(pathlib.Path(folder, "refused"), rivals)
            expect(rivals, refused.returncode == 64 and why in refused.stderr, refused.stderr)
        panel, nowhere = PANEL[2], pathlib.Path(folder, "nowhere")
        for words, code, why in [(("report", whole), 1, "is of a panel's artifact, not of a run"),
                                 (("panel", "run", panel, "--out", nowhere, "--method", "tackt"), 64, "no method of this panel; it has "),
                                 (("panel", "run", panel, "--out", nowhere, "--only", "lost"), 64, "no rollout of this panel, which has such as "),
                                 (("policy", "try", panel), 64, "is no folder: name the one that it is in")]:
            refused = takt(*words)
            expect(words[0], refused.returncode == code and why in refused.stderr, refused.stderr)
    print("a panel ends with the seed that decides")


main()
