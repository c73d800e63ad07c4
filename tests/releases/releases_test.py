#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: what each release wrote is read by this build with exact ticks and stops, or refused in one sentence that names the version
which can; never as an empty run. Method: the folders tests/releases/VERSION, and this build's programs; a copy is read, for reports
are written beside what they tell of. Usage: releases_test.py SOURCE BIN_DIR"""
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

# Of each release's run: ticks, and the stops with their ticks and causes.
RUNS = {"0.2.0": (1000, [[925, "command_lost"]])}


def takt(bin_dir, *words):
    done = subprocess.run([bin_dir / "takt", *words], capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def is_refusal(code, errors):
    return code != 0 and errors.count("\n") == 1 and "this is takt " in errors


def main():
    source, bin_dir = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    folders = {folder.name: folder for folder in (source / "tests/releases").iterdir() if folder.is_dir()}
    assert folders.keys() == RUNS.keys(), folders
    for version, (ticks, stops) in RUNS.items():
        with tempfile.TemporaryDirectory() as place:
            run, artifact = pathlib.Path(place) / "run", pathlib.Path(place) / "artifact"
            shutil.copytree(folders[version] / "run", run)
            shutil.copytree(folders[version] / "artifact", artifact)
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
            code, said, errors = takt(bin_dir, "audit", artifact)
            assert code in (0, 1) and "of 3 rollouts" in said or code != 0 and errors.count("\n") == 1 and "takt.artifact/" in errors, (code, said, errors)
    return 0


if __name__ == "__main__":
    sys.exit(main())
