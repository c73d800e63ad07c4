# SPDX-License-Identifier: Apache-2.0
"""How old commands were when a peer saw their frames: what the judges of several cases share. arm6, of MIT drives."""
import json
import pathlib
import re
import sys

import numpy as np
import zstandard

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "client/python"))
import takt  # noqa: E402

JOINTS = 6  # ids 1 to 6 in the joints' order
MAX_AGE_MS = 150
WRITE_MS = 0.05  # the executive looks at its clock before it writes; then the kernel stamps what was written


def text_of(log):
    if log.suffix != ".zst":
        return log.read_text()
    with log.open("rb") as packed:
        return zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True).read().decode()


class Run:
    """What a case left in OUT: its only run, read by takt.open, as users read it. Times in ns of CLOCK_MONOTONIC.

    now, oldest, plays, mode: of every tick, when it began, the oldest sample behind its command, whether it played one, and the mode's name.
    """

    def __init__(self, out):
        runs = list(pathlib.Path(out).glob("runs/*"))
        if len(runs) != 1:
            sys.exit(f"{len(runs)} runs, not one")
        self.folder = runs[0]
        self.offset_ns = json.loads((self.folder / "manifest.json").read_text())["clock"]["monotonic_to_unix_ns"]
        opened = takt.open(self.folder)
        self.ticks, enums = opened.tick_array, opened.enumerations
        self.now = self.ticks["now"].astype(np.int64)
        self.oldest = self.now - sum(self.ticks["age_" + part].astype(np.int64) for part in ("sense", "queue", "infer", "publish", "hold"))
        usable = [value for value, name in enums["freshness"].items() if name in ("fresh", "aging")]
        self.mode = np.array([enums["mode"][value] for value in self.ticks["mode"].tolist()])
        self.plays = np.isin(self.ticks["freshness"], usable) & np.isin(self.mode, ("tracking", "degraded"))

    def tick_at(self, stamp):
        """Index of the tick that began last before this instant; -1: none did, or it is the last one recorded, whose end is unknown.

        A run folder that was copied while its executive ran can hold frames that are newer than its last tick.
        """
        at = np.searchsorted(self.now, stamp, side="right") - 1
        return at if at < len(self.now) - 1 else -1

    def command_frames(self, log, direction=""):
        """(joint, data, stamp) of every frame to a drive but those that enable, disable or clear an error; `direction` T or R, as in can.log.zst."""
        for line in text_of(log).splitlines():
            if found := re.match(r"\((\d+)\.(\d{6})\) vcan\d 00([1-6])#([0-9A-F]{16})" + (f" {direction}$" if direction else ""), line):
                if not found[4].startswith("FFFFFFFFFFFFFF"):
                    yield int(found[3]) - 1, found[4], int(found[1]) * 10**9 + int(found[2]) * 1000 - self.offset_ns

    def ages_on_wire(self, frames):
        """ms, of each frame that carries a command, by the peer's stamp; and us from the tick's beginning to the frame."""
        kept_back = np.append(self.ticks["last_damped"][1:], 0)  # said by the tick after
        ages, delays = [], []
        for joint, _, stamp in frames:
            at = self.tick_at(stamp)
            if 0 <= at < len(self.now) - 1 and self.plays[at] and not int(kept_back[at]) >> joint & 1:
                ages.append((stamp - self.oldest[at]) * 1e-6)
                delays.append((stamp - self.now[at]) * 1e-3)
        return np.array(ages), np.array(delays)
