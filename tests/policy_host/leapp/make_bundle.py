#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes a LEAPP bundle whose networks have the shapes that its YAML says: make_bundle.py FOLDER [YAML | history | t1]

Without YAML it is one of a 29-joint walker's: inputs, outputs, feedback and their names as WBC-AGILE's Velocity-G1-v0 has
them. With `history` likewise, as Velocity-Height-G1-History-v0 has them: five instants of all that it sees are feedback, and of four
commanded values none has a name. With `t1` of a 23-joint walker's, as Velocity-T1-v0 has them: five instants of what the policy observes are
feedback, between the inputs, and the training's gains and poses of the joints stand beside them. With a YAML, that file's (its `sha256sum`s are replaced). Networks: all inputs, flat, through a hidden layer of tanh to
each output; gains are 40 + 10 tanh. Opset 20. Values are drawn from a fixed seed, start values of the feedback too.
"""
import hashlib
import json
import pathlib
import struct
import sys

import numpy as np
import onnx
import yaml
from onnx import TensorProto, helper, numpy_helper

JOINTS = """left_hip_pitch_joint right_hip_pitch_joint waist_yaw_joint left_hip_roll_joint right_hip_roll_joint
waist_roll_joint left_hip_yaw_joint right_hip_yaw_joint waist_pitch_joint left_knee_joint right_knee_joint
left_shoulder_pitch_joint right_shoulder_pitch_joint left_ankle_pitch_joint right_ankle_pitch_joint
left_shoulder_roll_joint right_shoulder_roll_joint left_ankle_roll_joint right_ankle_roll_joint left_shoulder_yaw_joint
right_shoulder_yaw_joint left_elbow_joint right_elbow_joint left_wrist_roll_joint right_wrist_roll_joint
left_wrist_pitch_joint right_wrist_pitch_joint left_wrist_yaw_joint right_wrist_yaw_joint""".split()
LEGS = [joint for joint in JOINTS if any(part in joint for part in ("hip", "knee", "ankle"))]
T1_JOINTS = """AAHead_yaw Left_Shoulder_Pitch Right_Shoulder_Pitch Waist Head_pitch Left_Shoulder_Roll Right_Shoulder_Roll Left_Hip_Pitch
Right_Hip_Pitch Left_Elbow_Pitch Right_Elbow_Pitch Left_Hip_Roll Right_Hip_Roll Left_Elbow_Yaw Right_Elbow_Yaw Left_Hip_Yaw Right_Hip_Yaw
Left_Knee_Pitch Right_Knee_Pitch Left_Ankle_Pitch Right_Ankle_Pitch Left_Ankle_Roll Right_Ankle_Roll""".split()
T1_LEGS = [joint for joint in T1_JOINTS if any(part in joint for part in ("Hip", "Knee", "Ankle"))]
HIDDEN = 64


def tensor(name, width, kind=None, names=None, connection=None):
    entry = {"name": name, "dtype": "float32", "shape": [1, width], "type": "tensor"}
    if kind:
        entry["kind"] = kind
    if names:
        entry["element_names"] = [list(names)]
    if connection:
        entry["isaaclab_connection"] = connection
    return entry


def walker(with_history=False):
    name = "walk"
    inputs = [
        tensor("base_velocity", 4, "command/body/velocity", ["lin_vel_x", "lin_vel_y", "ang_vel_z"], "command:base_velocity"),
        tensor("robot_root_lin_vel_b", 3, "state/body/linear_velocity", "xyz", "state:robot:root_lin_vel_b"),
        tensor("robot_root_ang_vel_b", 3, "state/body/angular_velocity", "xyz", "state:robot:root_ang_vel_b"),
        tensor("robot_root_quat_w", 4, "state/body/rotation", ["qx", "qy", "qz", "qw"], "state:robot:root_quat_w"),
        tensor("robot_joint_pos", 29, "state/joint/position", JOINTS, "state:robot:joint_pos"),
        tensor("robot_joint_vel", 29, "state/joint/velocity", JOINTS, "state:robot:joint_vel"),
        tensor("last_action_in", 12)]
    outputs = [
        tensor("joint_pos", 12, "target/joint/position", LEGS, "write:robot:set_joint_position_target_index"),
        tensor("last_action_out", 12),
        tensor("joint_pos_kp_gains", 12, "kp", LEGS, "write:robot:write_joint_stiffness_to_sim_index"),
        tensor("joint_pos_kd_gains", 12, "kd", LEGS, "write:robot:write_joint_damping_to_sim_index")]
    fed_back = ["last_action"]
    if with_history:
        inputs.pop(1)
        inputs[0].pop("element_names")
        for what, width in (("commands", 4), ("ang_vel", 3), ("gravity", 3), ("joint_pos", 29), ("joint_vel", 29), ("actions", 12)):
            for tensors, way in ((inputs, "in"), (outputs, "out")):
                tensors.insert(-1, history(what, way, width))
            fed_back.append(f"h_policy_{what}")
    return bundle(name, inputs, outputs, fed_back)


def history(what, way, width):
    return {**tensor(f"h_policy_{what}_{way}", width), "shape": [5, 1, width]}


def t1():
    observed = [("base_ang_vel", 3), ("projected_gravity", 3), ("velocity_commands", 3), ("controlled_joint_pos", 12), ("controlled_joint_vel", 12)]
    read = [
        tensor("robot_root_ang_vel_b", 3, "state/body/angular_velocity", "xyz", "state:robot:root_ang_vel_b"),
        tensor("robot_root_quat_w", 4, "state/body/rotation", ["qx", "qy", "qz", "qw"], "state:robot:root_quat_w"),
        tensor("base_velocity", 3, "command/body/velocity", ["lin_vel_x", "lin_vel_y", "ang_vel_z"], "command:base_velocity"),
        tensor("robot_joint_pos", 23, "state/joint/position", T1_JOINTS, "state:robot:joint_pos"),
        tensor("robot_joint_vel", 23, "state/joint/velocity", T1_JOINTS, "state:robot:joint_vel")]
    inputs = [entry for source, (what, width) in zip(read, observed) for entry in (source, history(what, "in", width))]
    inputs += [tensor("last_action_in", 12), history("actions", "in", 12)]
    outputs = [tensor("joint_pos", 12, "target/joint/position", T1_LEGS, "write:robot:set_joint_position_target_index")]
    outputs += [history(what, "out", width) for what, width in observed]
    outputs += [tensor("last_action_out", 12), history("actions", "out", 12),
                tensor("joint_pos_kp_gains", 12, "kp", T1_LEGS, "write:robot:write_joint_stiffness_to_sim_index"),
                tensor("joint_pos_kd_gains", 12, "kd", T1_LEGS, "write:robot:write_joint_damping_to_sim_index")]
    made = bundle("walk", inputs, outputs, [f"h_policy_{what}" for what, _ in observed] + ["h_policy_actions", "last_action"])
    stiff = [100.0 if any(part in joint for part in ("Hip", "Knee", "Waist")) else 20.0 for joint in T1_JOINTS]
    pose = {"Left_Shoulder_Roll": -1.2999999523162842, "Right_Shoulder_Roll": 1.2999999523162842, "Left_Knee_Pitch": 0.4000000059604645,
            "Right_Knee_Pitch": 0.4000000059604645}
    made["agile"] = {"articulations": {"robot": {
        "joint_names": T1_JOINTS, "default_joint_pos": [pose.get(joint, 0.0) for joint in T1_JOINTS], "default_joint_stiffness": stiff,
        "default_joint_damping": [2.5 if gain == 100.0 else 0.5 for gain in stiff]}}}
    return made


def bundle(name, inputs, outputs, fed_back):
    ports = lambda tensors: [entry["name"] for entry in tensors if "kind" in entry]
    return {
        "models": {name: {"inputs": inputs, "outputs": outputs,
                          "parameters": {"model_path": f"{name}.onnx", "sha256sum": "", "backend": "onnx", "opset_version": 20}}},
        "pipeline": {"data_flow": {}, "feedback_flow": {f"{name}/{what}_out": [f"{name}/{what}_in"] for what in fed_back},
                     "initial_values": f"{name}_initial_values.safetensors", "inputs": {name: ports(inputs)},
                     "outputs": {name: ports(outputs)}, "configs": {"frequency": 50.0}},
        "system information": {"leapp config version": "1.1"}}


def network(node, random):
    """Its bytes."""
    nodes, constants = [], []

    def constant(name, values):
        constants.append(numpy_helper.from_array(values, name))
        return name

    def value(entry):
        return helper.make_tensor_value_info(entry["name"], TensorProto.FLOAT, entry["shape"])

    def layer(source, width_in, width_out, to):
        weights = (random.standard_normal((width_in, width_out)) / np.sqrt(width_in)).astype(np.float32)
        bias = (0.1 * random.standard_normal(width_out)).astype(np.float32)
        nodes.append(helper.make_node("Gemm", [source, constant(to + "_w", weights), constant(to + "_b", bias)], [to + "_gemm"]))
        nodes.append(helper.make_node("Tanh", [to + "_gemm"], [to]))

    for entry in node["inputs"]:
        constant(entry["name"] + "_flat", np.array([1, -1], np.int64))
        nodes.append(helper.make_node("Reshape", [entry["name"], entry["name"] + "_flat"], [entry["name"] + "_row"]))
    width = sum(int(np.prod(entry["shape"])) for entry in node["inputs"])
    nodes.append(helper.make_node("Concat", [entry["name"] + "_row" for entry in node["inputs"]], ["all"], axis=1))
    layer("all", width, HIDDEN, "hidden")
    for entry in node["outputs"]:
        name, size = entry["name"], int(np.prod(entry["shape"]))
        layer("hidden", HIDDEN, size, name + "_row")
        row = name + "_row"
        if entry.get("kind") in ("kp", "kd"):
            nodes.append(helper.make_node("Mul", [row, constant(name + "_ten", np.array([10], np.float32))], [name + "_scaled"]))
            nodes.append(helper.make_node("Add", [name + "_scaled", constant(name + "_forty", np.array([40], np.float32))],
                                          [name + "_gain"]))
            row = name + "_gain"
        constant(name + "_shape", np.array(entry["shape"], np.int64))
        nodes.append(helper.make_node("Reshape", [row, name + "_shape"], [name]))
    graph = helper.make_graph(nodes, "network", [value(entry) for entry in node["inputs"]],
                              [value(entry) for entry in node["outputs"]], constants)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)], ir_version=9).SerializeToString()


def safetensors(values):
    header, data = {}, b""
    for key, array in values.items():
        raw = array.astype("<f4").tobytes()
        header[key] = {"dtype": "F32", "shape": list(array.shape), "data_offsets": [len(data), len(data) + len(raw)]}
        data += raw
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def main(folder, source=None):
    folder = pathlib.Path(folder)
    random = np.random.default_rng(7)
    made = {None: walker, "history": lambda: walker(with_history=True), "t1": t1}
    written = made[source]() if source in made else yaml.safe_load(pathlib.Path(source).read_text())
    for node in written["models"].values():
        model = network(node, random)
        node["parameters"]["sha256sum"] = hashlib.sha256(model).hexdigest()
        (folder / node["parameters"]["model_path"]).write_bytes(model)
    starts = {}
    for targets in written["pipeline"]["feedback_flow"].values():
        for port in targets:
            name, tensor_name = port.rsplit("/", 1)
            shape = next(entry["shape"] for entry in written["models"][name]["inputs"] if entry["name"] == tensor_name)
            starts[port] = random.standard_normal(shape)
    (folder / written["pipeline"]["initial_values"]).write_bytes(safetensors(starts))
    # No aliases for lists that repeat: exporters write none.
    yaml.SafeDumper.ignore_aliases = lambda *_: True
    name = pathlib.Path(written["pipeline"]["initial_values"]).name.removesuffix("_initial_values.safetensors")
    (folder / f"{name}.yaml").write_text(yaml.safe_dump(written, sort_keys=False))
    print(folder / f"{name}.yaml")


if __name__ == "__main__":
    main(*sys.argv[1:])
