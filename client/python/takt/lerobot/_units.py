# SPDX-License-Identifier: Apache-2.0
"""What a data set's numbers are: checkpoints do not say it, and Takt's joints are in rad, slides in m."""
import math
import re
from typing import Dict, List, NamedTuple, Tuple

import numpy as np

from takt import _library
from takt._refused import Refused
from takt.lerobot._checkpoint import Affine

_UNITS: Dict[str, float] = {"rad": 1.0, "deg": math.pi / 180, "m": 1.0, "mm": 1e-3}
_NUMBER = r"(-?\d+(?:\.\d+)?)"
_RANGE = re.compile(rf"{_NUMBER}\.\.{_NUMBER} is {_NUMBER}\.\.{_NUMBER} (rad|deg|m|mm)")
_FORM = "write one such as elbow=deg, elbow=rad, slide=mm, or gripper=\"0..100 is -10..95 deg\""


class Joint(NamedTuple):
    """rad or m = gain * value + shift, of the data set's value."""

    name: str
    gain: float
    shift: float


def joint(text: str) -> Joint:
    """Of NAME=UNIT, or NAME="LOW..HIGH is LOW..HIGH UNIT"."""
    name, _, unit = text.partition("=")
    unit = unit.strip()
    if not name or len(text) > 200 or not all(c.isalnum() or c in " _-+./:()" for c in name):
        raise Refused(f"--joint {text[:60]!r} names no joint; {_FORM}", _library.USAGE)
    if unit in _UNITS:
        return Joint(name, _UNITS[unit], 0.0)
    found = _RANGE.fullmatch(unit)
    if not found:
        raise Refused(f"--joint {text[:60]!r} has no unit; {_FORM}", _library.USAGE)
    low, high, first, last = (float(one) for one in found.groups()[:4])
    if low == high or first == last:
        raise Refused(f"--joint {text[:60]!r}: a range is empty; {_FORM}", _library.USAGE)
    gain = (last - first) / (high - low)
    return Joint(name, gain * _UNITS[found[5]], (first - gain * low) * _UNITS[found[5]])


def to_robot(joints: List[Joint]) -> Affine:
    return Affine(np.array([one.gain for one in joints]), np.array([one.shift for one in joints]))


def to_data(joints: List[Joint]) -> Affine:
    robot = to_robot(joints)
    return Affine(1 / robot.gain, -robot.shift / robot.gain)


def frequency(text: str) -> Tuple[float, str]:
    """Of --fps: frames in a second, and the time between two as a robot file writes it, to a nanosecond."""
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 0.1 <= rate <= 1000:
        raise Refused(f"--fps {text[:60]!r} is no frequency from 0.1 to 1000; it is `fps` in the data set's meta/info.json", _library.USAGE)
    return rate, f"{1000 / rate:.6f}".rstrip("0").rstrip(".") + " ms"
