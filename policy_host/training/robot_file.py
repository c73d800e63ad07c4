# SPDX-License-Identifier: Apache-2.0
"""A robot file as a dictionary, with the keys of the file that it is based on (docs/configuration.md)."""
import pathlib

import yaml


def _joined(own, base):
    joined = dict(base)
    for key, value in own.items():
        both = isinstance(value, dict) and isinstance(base.get(key), dict)
        joined[key] = _joined(value, base[key]) if both else value
    return joined


def read(path):
    path = pathlib.Path(path)
    robot = yaml.safe_load(path.read_text(encoding="utf-8"))
    if "based_on" not in robot:
        return robot
    base = yaml.safe_load((path.parent / robot.pop("based_on")).read_text(encoding="utf-8"))
    return _joined(robot, base)
