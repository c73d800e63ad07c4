#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the JSON Schema that editors get accepts every robot file of config/, and marks what they should mark. Method: an
independent validator (python3-jsonschema) on config/*.yaml, and on copies of one with a single mistake each, planted at a
path. Usage: json_schema_test.py TAKT CONFIG_DIR. Exit codes: 0 fine, 1 not, 77 the validator is not installed.
"""
import copy
import json
import pathlib
import subprocess
import sys

# Path in config/arm6.yaml, what is written there, whether that is a mistake.
CHANGES = [
    (["control", "period"], "1ms", False),
    (["control", "period"], "1 rad", True),
    (["control", "period"], 1, True),
    (["control", "perod"], "1 ms", True),
    (["control", "cpu"], "none", False),
    (["control", "cpu"], "all", True),
    (["control", "wake"], "snooze", True),
    (["freshness", "epsilon"], "1e-3", False),
    (["freshness", "epsilon"], 2, True),
    (["joints", 0, "limits", "position"], ["-30deg", "0.5rad"], False),
    (["joints", 0, "limits", "position"], ["-30deg"], True),
    (["joints", 0, "limits", "colour"], "red", True),
    (["joints", 0, "passive"], "no", True),
    (["joint_defaults"], [{"joints": ["*"], "inertia": "1kgm2"}], False),
    (["joint_defaults"], [{"joints": "*", "inertia": "1kgm2"}], True),
    (["joint_defaults"], [{"joints": ["*"], "name": "hip"}], True),
    (["robot"], "a robot", True),
    (["schema"], "takt.robot/2", True),
]


def changed(robot, path, value):
    result = copy.deepcopy(robot)
    at = result
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return result


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 64
    try:
        import jsonschema
        import yaml
    except ImportError as missing:
        print(f"SKIPPED: {missing}: THE SCHEMA FOR EDITORS WAS NOT TESTED (./dev test installs python3-jsonschema)")
        return 77
    schema = json.loads(subprocess.run([sys.argv[1], "config", "schema"], check=True, capture_output=True, text=True).stdout)
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    problems, robots = [], {}
    for file in sorted(pathlib.Path(sys.argv[2]).glob("*.yaml")):
        robot = yaml.safe_load(file.read_text())
        if robot.get("schema") != "takt.robot/1":
            continue
        robots[file.stem] = robot
        problems += [f"{file.name}: {error.json_path}: {error.message}" for error in validator.iter_errors(robot)]
    for path, value, is_mistake in CHANGES:
        if validator.is_valid(changed(robots["arm6"], path, value)) == is_mistake:
            problems.append(f"{path} = {value!r} is {'accepted' if is_mistake else 'refused'}")
    if validator.is_valid({"based_on": "arm6.yaml", "policy": {"file": 1}}):
        problems.append("a wrong value beside based_on is accepted")
    for key in ("freshness", "joints"):
        without = {name: value for name, value in robots["arm6"].items() if name != key}
        if validator.is_valid(without):
            problems.append(f"a file without {key} is accepted")
    print("\n".join(problems) or f"{len(robots)} robot files and {len(CHANGES)} changes judged as they should be")
    return 1 if problems or len(robots) < 4 else 0


if __name__ == "__main__":
    sys.exit(main())
