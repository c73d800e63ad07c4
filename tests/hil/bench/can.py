#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""can.py OUT: system calls per period and the time from wake-up to each frame on the bus, of Takt and of a loop that only writes."""
import pathlib
import re
import sys

import numpy as np

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from rig.wire_age import JOINTS, Run  # noqa: E402

LINE = re.compile(r"\((\d+)\.(\d{6})\) vcan\d 00([1-6])#")


def stamps(log):
    """ns of CLOCK_REALTIME, of each frame to a drive."""
    found = [LINE.match(line) for line in log.read_text().splitlines()]
    return np.array([int(one[1]) * 10**9 + int(one[2]) * 1000 for one in found if one])


def delays_us(woken, sent):
    """From the last wake-up before a frame to the frame; of whole periods only. One row per period."""
    at = np.searchsorted(woken, sent, side="right") - 1
    return [(sent[at == period] - woken[period]) * 1e-3 for period in range(1, len(woken) - 1) if np.count_nonzero(at == period) == JOINTS]


SLEEP = 230  # clock_nanosleep of x86-64: one per period


def calls_per_period(path):
    """Of what is called in every period: the rest is the start and the end."""
    counts = {int(number): int(count) for number, count in re.findall(r"id: +(\d+) \} hitcount: +(\d+)", path.read_text())}
    return sum(count / counts[SLEEP] for count in counts.values() if count >= counts[SLEEP] / 2)


def row(name, per_period, delays):
    first, last = np.array([one.min() for one in delays]), np.array([one.max() for one in delays])
    figures = [np.percentile(values, share) for values in (first, last) for share in (50, 99)]
    print(f"{name:12}  {per_period:5.2f}  {figures[0]:9.0f} {figures[1]:5.0f}  {figures[2]:8.0f} {figures[3]:5.0f}   ({len(delays)} periods)")
    return figures


def main():
    out = pathlib.Path(sys.argv[1])
    run = Run(out)
    plain_woken = np.array([int(line) // 1000 * 1000 for line in (out / "plain.woken").read_text().split()])  # as coarse as candump
    takt = delays_us((run.now + run.offset_ns) // 1000 * 1000, stamps(out / "takt.log"))
    plain = delays_us(plain_woken, stamps(out / "plain.log"))
    if min(len(takt), len(plain)) < 1000:
        sys.exit(f"{len(takt)} periods of Takt and {len(plain)} of the plain loop: too few to judge")
    print("wake-up to frame on the bus, us, by the peer's stamps; system calls of the thread per period")
    print(f"{'':12}  {'calls':>5}  {'first p50':>9} {'p99':>5}  {'last p50':>8} {'p99':>5}")
    ours = row("takt", calls_per_period(out / "takt.calls"), takt)
    floor = row("write loop", calls_per_period(out / "plain.calls"), plain)
    print(f"takt / write loop: first {ours[0] / floor[0]:.1f}, last {ours[2] / floor[2]:.1f} times")


main()
