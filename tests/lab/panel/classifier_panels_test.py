#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the fault classifier names what was planted: both of two causes, and a single one near the dose from which it troubles the robot.
Method: a sample of config/panels/mixtures.yaml and of doses.yaml is rolled out; the shares in confusion.json are held to floors.
Usage: classifier_panels_test.py REPOSITORY TAKT
"""
import json
import subprocess
import sys
import tempfile


def confusion_of(root, takt, folder, panel, *sample):
    said = subprocess.run([takt, "panel", "run", f"{root}/config/panels/{panel}.yaml", *sample, "--workers", "2", "--out", f"{folder}/{panel}"],
                          capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    with open(f"{folder}/{panel}/confusion.json", encoding="utf-8") as file:
        return json.load(file)["methods"]["takt"], said.stdout


def main():
    root, takt = sys.argv[1:3]
    with tempfile.TemporaryDirectory() as folder:
        confusion, said = confusion_of(root, takt, folder, "mixtures", "--seeds", "1")
        mixtures = confusion["mixtures"]
        assert mixtures["rollouts"] > 50 and mixtures["all_named"] >= 0.90 * mixtures["rollouts"], said
        assert len(mixtures["causes"]) >= 7 and all(one["recall"] is None or one["recall"] >= 0.90 for one in mixtures["causes"].values()), said
        assert confusion["nominal"] == {"rollouts": 3, "labelled": 0}, said
        confusion, said = confusion_of(root, takt, folder, "doses", "--seeds", "1", "--shard", "2/5")
        assert len(confusion["planted"]) == 7 and confusion["without_trouble"] < 25, said
        assert confusion["macro_recall_of_troubled"] >= 0.95 and confusion["macro_precision"] >= 0.95, said
        print(f"{mixtures['all_named']} of {mixtures['rollouts']} mixtures named, recall {confusion['macro_recall_of_troubled']:.3f} near thresholds")


if __name__ == "__main__":
    main()
