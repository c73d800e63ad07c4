#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: from published files to tracking in simulation with fewer than 20 manual edits, and nothing special to the robot that we tried first.
Method: `takt config import`, then every FILL_IN that it leaves is written by this script and counted as an edit; `takt config check` has to take
the file, and the robot has to do its task in virtual time, through drives, executive and policy.
- Unitree's G1 by its published policy (where ../shared has them) walks;
- the same robot with every body, joint, site and actuator renamed, its limbs in another order, motor slots with gaps between them: it walks;
- a quadruped of our own (tests/cli/robots) whose left legs' bodies and right legs' actuators come first, as on Unitree's, in a pose of which no two joints are
  alike: each of its motors has its own joint's angle and gains, and it stands;
- an arm of our own with another exporter's metadata tracks.
Usage: first_robot_test.py SOURCE_DIR BIN_DIR. Exit codes: 0 fine, 1 not.
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree

import numpy as np
import onnx
import yaml
from onnx import TensorProto, helper, numpy_helper

MOST_EDITS = 20
PANEL = """schema: takt.panel/1
panel: first_robot
duration: 8 s
seeds: {{ count: 2 }}
policy: {{ inference: 2 ms }}
tasks: [{{ task: base_velocity, robot: {robot}, scored: 2 s, bound: 300 mm, command: [{speed}, 0, 0] }}]
methods: [{{ name: takt }}]
perturbations: [{{ kind: none }}]
"""


def write_policy(path, weights, bias, metadata=None):
    """actions = weights @ obs + bias"""
    outputs, inputs = weights.shape
    graph = helper.make_graph([helper.make_node("Gemm", ["obs", "w", "b"], ["actions"], transB=1)], "policy",
                              [helper.make_tensor_value_info("obs", TensorProto.FLOAT, [1, inputs])],
                              [helper.make_tensor_value_info("actions", TensorProto.FLOAT, [1, outputs])],
                              [numpy_helper.from_array(weights.astype(np.float32), "w"), numpy_helper.from_array(bias.astype(np.float32), "b")])
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
    helper.set_model_props(model, metadata or {})
    onnx.save(model, str(path))


class Robot:
    """One robot's way from its files to a task done."""

    def __init__(self, name, folder, programs):
        self.name, self.folder, self.programs, self.edits = name, folder, programs, []
        self.file = folder / f"{name}.yaml"

    def takt(self, *words):
        done = subprocess.run([self.programs / "takt", *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300)
        if done.returncode != 0:
            raise AssertionError(f"{self.name}: takt {' '.join(map(str, words))}: {done.returncode}\n{done.stdout}")
        return done.stdout

    def imported(self, *words):
        self.takt("config", "import", *words, "--simulated", "--robot", self.name, "-o", self.file)

    def edit(self, place, value):
        """Writes `value` in place of the first FILL_IN behind `place`, a regular expression."""
        text = self.file.read_text()
        found = re.search(place + r"[^\n]*?FILL_IN", text)
        if found is None:
            raise AssertionError(f"{self.name}: no FILL_IN behind {place}")
        end = found.end()
        self.file.write_text(text[:end - len("FILL_IN")] + value + text[end:])
        self.edits.append(f"{place}: {value}")

    def walks(self, speed):
        panel = self.folder / f"{self.name}.panel.yaml"
        panel.write_text(PANEL.format(robot=self.file, speed=speed))
        self.takt("config", "check", self.file)
        out = self.folder / f"{self.name}.rows"
        self.takt("panel", "run", panel, "--out", out)
        rows = [json.loads(line) for line in (out / "rollouts.jsonl").read_text().splitlines()]
        bad = [f"seed {row['seed']}: {row['failure_label']}, {row['tracking_error_rms_m']:.3f} m" for row in rows if not row["success"]]
        if len(rows) != 2 or bad:
            raise AssertionError(f"{self.name}: {bad or rows}")
        return max(row["tracking_error_rms_m"] for row in rows)

    def tracks(self):
        self.takt("config", "check", self.file)
        said = self.takt("deploy", self.file, "--store", self.folder / "store", "--runtime-dir", self.folder / "runtime", "--runs", self.folder / "runs", "--no-restart")
        if "tracked for 5 s in virtual time" not in said:
            raise AssertionError(f"{self.name}: {said}")

    def report(self, what):
        print(f"{self.name}: {what}, {len(self.edits)} manual edits")
        if len(self.edits) >= MOST_EDITS:
            raise AssertionError(f"{self.name}: {len(self.edits)} edits, fewer than {MOST_EDITS} are wanted: {self.edits}")


def read_deploy(path):
    """Its Python tags are data."""
    loader = type("Loader", (yaml.SafeLoader,), {})
    loader.add_multi_constructor("tag:yaml.org,2002:python/", lambda loader, suffix, node: None)
    return yaml.load(path.read_text(), loader)


def hinges(root):
    return [joint.get("name") for joint in root.iter("joint") if joint.get("name") and joint.get("type", "hinge") == "hinge"]


def renamed_robot(model, deploy_file, folder):
    """The same robot with other names, limbs and actuators in another order, and motor slots with gaps; returns its files."""
    tree = ElementTree.parse(model)
    root = tree.getroot()
    before = hinges(root)
    for body in root.iter("body"):  # arms first, then legs
        parts = [child for child in body if child.tag == "body"]
        for part in parts:
            body.remove(part)
        body.extend(reversed(parts))
    actuator = root.find("actuator")
    actuator[:] = sorted(actuator, key=lambda motor: motor.get("joint")[::-1])
    order = [before.index(motor.get("joint")) for motor in actuator]  # of the motors: as the published robot's joints and motors stand alike
    names = {}
    for element in root.iter():
        for key in ("name", "joint", "joint1", "joint2", "body1", "body2", "site", "objname", "class", "childclass"):
            if element.get(key) and element.tag != "mujoco":
                element.set(key, names.setdefault(element.get(key), f"part{len(names):03}"))
    root.set("model", "somebody_elses")
    tree.write(folder / "renamed.xml")

    deploy = read_deploy(deploy_file)
    slots = [2 * place + 3 for place in range(len(before))]  # gaps: no motor at any even number
    now_at = {old: slots[new] for new, old in enumerate(order)}
    for gains in ("stiffness", "damping"):
        deploy[gains] = [deploy[gains][old] for old in order]
    deploy["joint_ids_map"] = [now_at[motor] for motor in deploy["joint_ids_map"]]
    (folder / "renamed.deploy.yaml").write_text(yaml.safe_dump(deploy, sort_keys=False))
    return folder / "renamed.xml", folder / "renamed.deploy.yaml"


QUADRUPED_LEGS = ("lf", "rf", "lh", "rh")  # as the policy has them
QUADRUPED_MOTORS = ("rf", "lf", "rh", "lh")
QUADRUPED_POSE = {"abduct": (0.06, -0.05, 0.04, -0.03), "swing": (0.75, 0.7, 0.8, 0.78), "bend": (-1.5, -1.4, -1.55, -1.45)}  # rad, by QUADRUPED_LEGS


def quadruped_deploy():
    """As Isaac Lab writes it: the policy's joints by kind, the robot's by leg, and the right legs' motors first."""
    ones = [1.0] * 12
    pose = [angle for angles in QUADRUPED_POSE.values() for angle in angles]
    slots = [3 * QUADRUPED_MOTORS.index(leg) + kind for kind in range(3) for leg in QUADRUPED_LEGS]
    assert slots[:4] == [3, 0, 9, 6], "as on the Go2"
    stiffness = [60.0 + slot for slot in range(12)]
    observation = {name: {"params": {}, "clip": None, "history_length": 1, "scale": [scale] * count} for name, scale, count in (
        ("base_ang_vel", 0.2, 3), ("projected_gravity", 1.0, 3), ("velocity_commands", 1.0, 3), ("joint_pos_rel", 1.0, 12), ("joint_vel_rel", 0.05, 12),
        ("last_action", 1.0, 12))}
    ranges = {"lin_vel_x": [-1.0, 1.0], "lin_vel_y": [-0.4, 0.4], "ang_vel_z": [-1.0, 1.0], "heading": None}
    return {"joint_ids_map": slots, "step_dt": 0.02, "stiffness": stiffness, "damping": [2.0] * 12,
            "default_joint_pos": pose, "commands": {"base_velocity": {"ranges": ranges}},
            "actions": {"JointPositionAction": {"clip": None, "joint_names": [".*"], "scale": [0.25 * one for one in ones], "offset": list(pose), "joint_ids": None}},
            "observations": observation}


def g1(source, folder, programs):
    shared = source.parent / "shared"
    model, policy, deploy = shared / "robots/g1/g1_29dof.xml", shared / "policies/g1_velocity/policy.onnx", shared / "policies/g1_velocity/deploy.yaml"
    if not all(path.exists() for path in (model, policy, deploy)):
        print("NOT TESTED: ../shared HAS NO PUBLISHED G1, NEITHER AS IT IS NOR RENAMED")
        assert os.environ.get("TAKT_REQUIRE_SHARED") != "1", "TAKT_REQUIRE_SHARED is set"
        return
    published = Robot("g1", folder, programs)
    published.imported(deploy, "--policy", policy, "--model", model)
    error = published.walks(0.5)
    published.report(f"walks, {1e3 * error:.0f} mm off in a second")
    renamed = Robot("renamed", folder, programs)
    other_model, other_deploy = renamed_robot(model, deploy, folder)
    renamed.imported(other_deploy, "--policy", policy, "--model", other_model)
    assert "hip" not in renamed.file.read_text() and "imu: { site: part" in renamed.file.read_text(), "it was renamed"
    error = renamed.walks(0.5)
    renamed.report(f"walks, {1e3 * error:.0f} mm off in a second")


def quadruped(source, folder, programs):
    robot = Robot("quadruped", folder, programs)
    write_policy(folder / "stand.onnx", np.zeros((12, 45)), np.zeros(12))
    (folder / "deploy.yaml").write_text(yaml.safe_dump(quadruped_deploy(), sort_keys=False))
    robot.imported(folder / "deploy.yaml", "--policy", folder / "stand.onnx", "--model", source / "tests/cli/robots/quadruped.xml")
    joints = {joint["name"]: joint for joint in yaml.safe_load(robot.file.read_text())["joints"]}
    for kind, name in enumerate(QUADRUPED_POSE):
        for leg, angle in zip(QUADRUPED_LEGS, QUADRUPED_POSE[name]):
            joint, stiffness = joints[f"{leg}_{name}"], 60 + 3 * QUADRUPED_MOTORS.index(leg) + kind
            if (joint["home"], joint["gains"]["kp"]) != (f"{angle:g} rad", f"{stiffness} Nm/rad"):
                raise AssertionError(f"quadruped: {leg}_{name} was given {joint['home']} and {joint['gains']['kp']}, {angle} rad and {stiffness} are its own")
    if "motors are numbered as the model's actuators stand (rf_abduct, ...), not as its bodies do (lf_abduct, ...)" not in robot.file.read_text():
        raise AssertionError("quadruped: the import does not say which order it took")
    robot.walks(0)
    robot.report("stands")


def arm(source, folder, programs):
    robot = Robot("arm", folder, programs)
    metadata = {"joint_names": "wrist,elbow,shoulder,waist", "joint_stiffness": "20.0,40.0,60.0,60.0", "joint_damping": "0.5,1.0,2.0,2.0",
                "default_joint_pos": "0.3,0.6,-0.5,0.0", "action_scale": "0.5,0.5,0.5,0.5", "observation_names": "joint_pos,joint_vel,actions",
                "observation_history_lengths": "1,1,1"}
    weights = np.hstack([-0.2 * np.eye(4), np.zeros((4, 8))])
    write_policy(folder / "reach.onnx", weights, np.array([0.2, -0.3, 0.2, 0.5]), metadata)
    robot.imported(folder / "reach.onnx", "--model", source / "tests/cli/robots/arm.urdf", "--period", "20ms")
    for term, scale in (("joint_position_relative", "1"), ("joint_velocity", "0.1"), ("last_action", "1")):
        robot.edit("term: ", term)
        robot.edit(f"term: {term}, scale: ", scale)
    robot.edit("offset: ", "home")
    robot.tracks()
    robot.report("tracks")


def main():
    source, programs = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    with tempfile.TemporaryDirectory() as folder:
        for each in (g1, quadruped, arm):
            each(source, pathlib.Path(folder), programs)
    return 0


if __name__ == "__main__":
    sys.exit(main())
