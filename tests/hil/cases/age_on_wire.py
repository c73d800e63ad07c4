#!/usr/bin/python3
"""age_on_wire.py OUT: how old commands were when a peer saw their frames, in what the case of that name left in OUT.

Ticks are read by takt.open, as users read them. A frame belongs to the tick that began last before the
peer's stamp; it carries a command if that tick played one and did not keep this joint's setpoint back. Fails when a command was
older than max_age then, or when there was too little to judge.
"""
import json
import pathlib
import re
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "client/python"))
import takt  # noqa: E402

JOINTS = 6  # MIT, ids 1 to 6 in the joints' order
MAX_AGE_MS = 150
WRITE_MS = 0.05  # the executive looks at its clock before it writes; then the kernel stamps what was written
ENOUGH = 20_000


def enabled_frames(log, offset_ns):
    """(joint, ns of CLOCK_MONOTONIC) of every command frame; those that enable, disable or clear an error are none."""
    for line in log.read_text().splitlines():
        if found := re.match(r"\((\d+)\.(\d{6})\) vcan\d 00([1-6])#([0-9A-F]{16})", line):
            if not found[4].startswith("FFFFFFFFFFFFFF"):
                yield int(found[3]) - 1, int(found[1]) * 10**9 + int(found[2]) * 1000 - offset_ns


def ages_on_wire(run, frames):
    """ms, of each frame that carries a command; and us from the tick's beginning to the frame."""
    opened = takt.open(run)
    ticks, enums = opened.tick_array, opened.enumerations
    oldest = ticks["now"].astype(np.int64) - sum(ticks["age_" + part].astype(np.int64) for part in ("sense", "queue", "infer", "publish", "hold"))
    usable = [value for value, name in enums["freshness"].items() if name in ("fresh", "aging")]
    plays = np.isin(ticks["freshness"], usable) & np.isin(ticks["mode"], [value for value, name in enums["mode"].items() if name in ("tracking", "degraded")])
    kept_back = np.append(ticks["last_damped"][1:], 0)  # said by the tick after
    ages, delays = [], []
    for joint, stamp in frames:
        at = np.searchsorted(ticks["now"], stamp, side="right") - 1
        if 0 <= at < len(ticks) - 1 and plays[at] and not int(kept_back[at]) >> joint & 1:
            ages.append((stamp - oldest[at]) * 1e-6)
            delays.append((stamp - int(ticks["now"][at])) * 1e-3)
    return np.array(ages), np.array(delays)


def main():
    out = pathlib.Path(sys.argv[1])
    runs = list(out.glob("runs/*"))
    if len(runs) != 1:
        sys.exit(f"{len(runs)} runs, not one")
    (run,) = runs
    clock = json.loads((run / "manifest.json").read_text())["clock"]
    ages, delays = ages_on_wire(run, enabled_frames(out / "frames.log", clock["monotonic_to_unix_ns"]))
    if len(ages) < ENOUGH:
        sys.exit(f"only {len(ages)} frames with a command: too few to judge")
    print(f"{len(ages)} frames with a command, by the peer's stamps: age p50 {np.median(ages):.1f}, p99 {np.percentile(ages, 99):.1f}, "
          f"largest {ages.max():.1f} ms (max_age {MAX_AGE_MS}); from the tick's begin p50 {np.median(delays):.0f}, largest {delays.max():.0f} us")
    if ages.max() > MAX_AGE_MS + WRITE_MS:
        sys.exit(f"{np.count_nonzero(ages > MAX_AGE_MS + WRITE_MS)} frames carry a command older than {MAX_AGE_MS} ms")


main()
