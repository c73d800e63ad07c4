#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: Takt makes no shipped robot worse than a plain loop or a plain time-out does. Method: ten seeds of config/panels/harm.yaml are
rolled out; in no condition may a rival do better beyond chance, nor over all of them, and after a loss Takt must beat the plain loop.
Usage: harm_panel_test.py REPOSITORY TAKT
"""
import re
import subprocess
import sys
import tempfile

LINE = re.compile(r"^(\S+) +(\S+) +(\S+)? +(plain|timeout) +(\d+) +(\d+) +(\d+) .*(holds|better|fails|open)")


def main():
    root, takt = sys.argv[1:3]
    with tempfile.TemporaryDirectory() as folder:
        said = subprocess.run([takt, "panel", "run", f"{root}/config/panels/harm.yaml", "--seeds", "10", "--workers", "2", "--out", f"{folder}/harm"],
                              capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    lines = [LINE.match(line) for line in said.stdout.splitlines()]
    found = [line.groups() for line in lines if line]
    over_all = {(one[1], one[3]): one for one in found if one[0] == "all"}
    assert len(found) > 60 and len(over_all) == 4, said.stdout
    worse = [one for one in found if one[7] == "fails" or (one[0] == "all" and int(one[5]) < int(one[6]))]
    assert not worse, worse
    assert over_all["troubled", "plain"][7] == "better", over_all
    lost = [one for one in found if one[1] == "policy_crash" and one[3] == "plain" and one[0] != "arm_tracking"]
    assert len(lost) == 2 and all(one[7] == "better" for one in lost), lost
    print(f"{len(found)} lines, none worse")


if __name__ == "__main__":
    main()
