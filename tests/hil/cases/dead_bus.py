#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""dead_bus.py OUT: that nothing too old left a bus which had stood still, in what the case of that name left in OUT.

The run's own can.log.zst says which tick wrote a frame, the peer's log when it was on the bus: the newest one written before with the same
bytes. Fails when a command was older than max_age then, when the bus had never stood still, or when there was too little to judge.
"""
import bisect
import collections
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig.wire_age import MAX_AGE_MS, WRITE_MS, Run  # noqa: E402

ENOUGH = 5_000
ON_VCAN0 = 3  # arm6's first joints
STAMP_NS = 1000  # both logs cut to microseconds


def main():
    out = pathlib.Path(sys.argv[1])
    run = Run(out)
    written = collections.defaultdict(list)
    for joint, data, stamp in run.command_frames(run.folder / "can.log.zst", "T"):
        if joint < ON_VCAN0:
            written[joint, data].append(stamp)
    ages, longest_ms, thrown = [], 0.0, sum(map(len, written.values()))
    recorded_to = max((stamps[-1] for stamps in written.values()), default=0)  # the folder was copied while the executive ran
    for joint, data, stamp in run.command_frames(out / "frames.log"):
        if stamp > recorded_to + STAMP_NS:
            break
        candidates = written[joint, data]
        newest = bisect.bisect_right(candidates, stamp + STAMP_NS) - 1
        if newest < 0:
            continue
        thrown -= 1
        longest_ms = max(longest_ms, (stamp - candidates[newest]) * 1e-6)
        at = run.tick_at(candidates[newest])
        if at >= 0 and run.plays[at]:
            ages.append((stamp - run.oldest[at]) * 1e-6)
    if len(ages) < ENOUGH:
        sys.exit(f"only {len(ages)} frames with a command: too few to judge")
    print(f"{len(ages)} frames with a command: the oldest {max(ages):.1f} ms (max_age {MAX_AGE_MS}) on the bus; the longest wait of any frame "
          f"{longest_ms:.0f} ms; {thrown} of those written never left")
    if max(ages) > MAX_AGE_MS + WRITE_MS:
        sys.exit(f"{sum(age > MAX_AGE_MS + WRITE_MS for age in ages)} frames carry a command older than {MAX_AGE_MS} ms")
    if thrown < 10:
        sys.exit("no queue was emptied: the bus never stood still")


main()
