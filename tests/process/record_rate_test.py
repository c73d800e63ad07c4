#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a robot that stands by for months, or works all day, does not fill its disk faster than docs/run-folder.md says. Method: the
demo arm by `takt run`, twice for a different time in each state; what the longer run holds more, by its ticks more, scaled to a day. Bytes
are counted, no time: a slow machine records fewer ticks, and a run that it stops is not judged.
Usage: record_rate_test.py SOURCE_DIR BIN_DIR
Exit codes: 0 fine, 1 not.
"""
import json
import pathlib
import subprocess
import sys
import tempfile

MOST_GB_A_DAY = {"standby": 2.0, "armed": 35.0}
SECONDS = {"standby": (12, 40), "armed": (6, 20)}
TICKS_A_DAY = 86_400 * 1000  # of the demo arm


def record(source, programs, folder, state, seconds):
    """Bytes of the run and ticks that it lasted; None: it stopped by itself."""
    run = folder / f"{state}{seconds}"
    words = [programs / "takt", "run", source / "config/arm6.yaml", "--runtime-dir", folder / "sockets", "--run-dir", run,
             "--duration", f"{seconds}s", "--allow-non-realtime", *(["--arm"] if state == "armed" else [])]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode == 2:
        return None
    assert done.returncode == 0, done.stderr
    ticks = json.loads((run / "manifest.json").read_text())["ticks"]
    return sum((run / file).stat().st_size for file in ("ticks.mcap", "can.log.zst")), ticks["last"] - ticks["first"] + 1


def main():
    source, programs = map(pathlib.Path, sys.argv[1:])
    wrong = []
    with tempfile.TemporaryDirectory() as name:
        for state, (short, long) in SECONDS.items():
            less, more = (record(source, programs, pathlib.Path(name), state, seconds) for seconds in (short, long))
            if less is None or more is None:
                print(f"{state}: NOT JUDGED: the robot was stopped; this machine is too busy")
                continue
            a_tick = (more[0] - less[0]) / (more[1] - less[1])
            gigabytes = a_tick * TICKS_A_DAY * 1e-9
            print(f"{state}: {a_tick:.1f} bytes a tick, {gigabytes:.2f} GB a day")
            if gigabytes > MOST_GB_A_DAY[state]:
                wrong.append(f"{state}: {gigabytes:.2f} GB a day, {MOST_GB_A_DAY[state]} are allowed")
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
