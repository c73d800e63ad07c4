#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: what a release, or a commit before the first one, wrote is read by this build with exact ticks and stops, or refused in one sentence that names the
version which can; never as an empty run. Method: the folders of tests/releases, and this build's programs; a copy is read, for reports are written beside what
they tell of. A run of a commit is the virtual robot's, whose policy freezes after 0.3 s, made by
`tests/releases/make_past_run.sh COMMIT FOLDER`; the ticks and stops below are those of its own transitions.jsonl.
Usage: releases_test.py SOURCE BIN_DIR"""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

LOST_AT_1025 = (1200, [[1025, "command_lost"]])
# Of each run: ticks, and the stops with their ticks and causes; and the version that it is of.
RUNS = {"0.2.0": ("0.2.0", 1000, [[925, "command_lost"]])} | {commit: ("of an unknown version", *LOST_AT_1025) for commit in ("6424c12b", "b59538d6", "bbb22ff3", "84e8c24f", "caeaae71", "31963ab5")}


def takt(bin_dir, *words):
    done = subprocess.run([bin_dir / "takt", *words], capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def is_refusal(code, errors):
    return code != 0 and errors.count("\n") == 1 and "this is takt " in errors


def own_stops(run):
    lines = [json.loads(line) for line in (run / "transitions.jsonl").read_text().splitlines()]
    return [[line["tick"], line["cause"]] for line in lines if line["to"] in ("damped_stop", "fault_latched")]


def check_run(bin_dir, run, version, ticks, stops):
    assert own_stops(run) == stops, own_stops(run)
    code, said, errors = takt(bin_dir, "report", "--json", run)
    if not is_refusal(code, errors):
        assert code == 0, errors
        told = json.loads(said)
        assert told["ticks"]["recorded"] == ticks and told["ticks"]["missing"] == 0, told["ticks"]
        found = [[one["tick"], one["cause"]] for one in told["incidents"]]
        assert found == stops, found
    code, said, errors = takt(bin_dir, "replay", run)
    same_fields = code == 0 and f"{ticks} " in said
    other_decision = code != 0 and f"takt {version}" in said
    assert same_fields or other_decision or is_refusal(code, errors), (code, said, errors)
    # The robot file that it ran: taken, or refused with what took a key's place.
    code, said, errors = takt(bin_dir, "config", "check", run / "config.yaml")
    refused = errors.strip().splitlines()
    assert code == 0 or code == 65 and refused and all("policy.file" in line or "since version" in line for line in refused), (code, errors)


def check_artifact(bin_dir, artifact):
    code, said, errors = takt(bin_dir, "audit", artifact)
    assert code in (0, 1) and "of 3 rollouts" in said or code != 0 and errors.count("\n") == 1 and "takt.artifact/" in errors, (code, said, errors)


def main():
    source, bin_dir = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    folders = {folder.name: folder for folder in (source / "tests/releases").iterdir() if folder.is_dir()}
    assert folders.keys() == RUNS.keys(), folders
    for name, (version, ticks, stops) in RUNS.items():
        with tempfile.TemporaryDirectory() as place:
            copy = pathlib.Path(place) / "copy"
            shutil.copytree(folders[name], copy)
            check_run(bin_dir, copy / "run", version, ticks, stops)
            if (copy / "artifact").exists():
                check_artifact(bin_dir, copy / "artifact")
    return 0


if __name__ == "__main__":
    sys.exit(main())
