#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""age_on_wire.py OUT: how old commands were when a peer saw their frames, in what the case of that name left in OUT.

A frame belongs to the tick that began last before the peer's stamp; it carries a command if that tick played one and did not keep
this joint's setpoint back. Fails when a command was older than max_age then, or when there was too little to judge.
"""
import pathlib
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig.wire_age import MAX_AGE_MS, WRITE_MS, Run  # noqa: E402

ENOUGH = 20_000


def main():
    out = pathlib.Path(sys.argv[1])
    run = Run(out)
    ages, delays = run.ages_on_wire(run.command_frames(out / "frames.log"))
    if len(ages) < ENOUGH:
        sys.exit(f"only {len(ages)} frames with a command: too few to judge")
    print(f"{len(ages)} frames with a command, by the peer's stamps: age p50 {np.median(ages):.1f}, p99 {np.percentile(ages, 99):.1f}, "
          f"largest {ages.max():.1f} ms (max_age {MAX_AGE_MS}); from the tick's begin p50 {np.median(delays):.0f}, largest {delays.max():.0f} us")
    if ages.max() > MAX_AGE_MS + WRITE_MS:
        sys.exit(f"{np.count_nonzero(ages > MAX_AGE_MS + WRITE_MS)} frames carry a command older than {MAX_AGE_MS} ms")


main()
