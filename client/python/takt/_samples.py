# SPDX-License-Identifier: Apache-2.0
"""The samples of outside sensors that a run holds: those that policies were shown, and the IMU's, which the executive reads itself."""
import json
import pathlib
import re
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple

import numpy as np
from numpy.typing import NDArray

from takt import _files

if TYPE_CHECKING:
    import pandas

_NOBODY_SPOKE = 2**64 - 1  # sequence of a command's when_absent, which no sensor sensed
_IMU = ("rotation_w", "rotation_x", "rotation_y", "rotation_z", "angular_velocity_x", "angular_velocity_y", "angular_velocity_z", "acceleration_x",
        "acceleration_y", "acceleration_z")

Key = Tuple[int, int, int]  # place in the robot file's `sensors`, sequence, sensed_at: a process that starts again counts from 1 again
COLUMNS = ("s", "sensor", "sequence", "sensed_at", "published_at", "values", "unit", "image")


def declared(config: pathlib.Path) -> Tuple[List[str], List[str], Optional[int]]:
    """Of a run's config.yaml, which is canonical: names and units of `sensors`, and which of them is the base's IMU."""
    lines = _files.text_of(config).splitlines()
    names: List[str] = []
    units: List[str] = []
    section, imu = "", ""
    for line in lines:
        if not line.startswith(" "):
            section = line.partition(":")[0]
        elif section == "imu" and (of_imu := re.fullmatch(r"  sensor: (\S+)", line)):
            imu = of_imu[1]
        elif section == "sensors" and (name := re.fullmatch(r"  - name: (\S+)", line)):
            names.append(name[1])
            units.append("unstated")
        elif section == "sensors" and names and (unit := re.fullmatch(r'    unit: (".*")', line)):
            units[-1] = json.loads(unit[1])
    return names, units, names.index(imu) if imu in names else None


def _of_imu(imu: Optional[int], ticks: NDArray[Any]) -> Dict[Key, Dict[str, Any]]:
    """Each tick has the newest one."""
    if imu is None or not len(ticks):
        return {}
    sequences, sensed = ticks["imu_sequence"], ticks["imu_sensed_at"]
    is_new = np.ones(len(ticks), bool)
    is_new[1:] = (sequences[1:] != sequences[:-1]) | (sensed[1:] != sensed[:-1])
    found = np.flatnonzero(is_new & (sequences != 0))
    values = np.stack([ticks["imu_" + name][found] for name in _IMU], axis=1)
    return {(imu, int(sequence), int(at)): {"published_at": None, "values": row, "image": ""}
            for sequence, at, row in zip(sequences[found], sensed[found], values)}


def table(pandas: Any, config: pathlib.Path, ticks: NDArray[Any], inputs: "pandas.DataFrame") -> "pandas.DataFrame":
    """Every sample once, by the instant at which it was sensed."""
    names, units, imu = declared(config)
    samples = _of_imu(imu, ticks)
    shown = [inputs["sample_" + name] for name in ("sensor", "sequence", "sensed_at", "published_at", "values", "image")] if len(inputs) else []
    for row in zip(*shown):
        for sensor, sequence, sensed_at, published_at, values, image in zip(*row):
            if sequence == _NOBODY_SPOKE:
                continue
            sample = samples.setdefault((int(sensor), int(sequence), int(sensed_at)), {"published_at": None, "values": values, "image": image})
            sample["published_at"] = int(published_at)
    begin = int(ticks["now"][0]) if len(ticks) else 0
    rows = [{"s": (sensed_at - begin) * 1e-9, "sensor": names[sensor] if sensor < len(names) else None, "sequence": sequence, "sensed_at": sensed_at,
             "unit": units[sensor] if sensor < len(names) else None, **samples[sensor, sequence, sensed_at]}
            for sensor, sequence, sensed_at in sorted(samples, key=lambda key: (key[2], key))]
    return pandas.DataFrame(rows, columns=COLUMNS).astype({"s": "float64", "sequence": "uint64", "sensed_at": "int64", "published_at": "Int64"})
