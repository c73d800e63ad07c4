# SPDX-License-Identifier: Apache-2.0
"""The robot file as training needs it: plain SI numbers, and the arm's forward kinematics for a whole batch at once.

Shapes: q is (batch, joints) in rad; positions are (batch, 3) in m in the base frame; Jacobians are (batch, 3, joints).
"""
import re
from dataclasses import dataclass

import numpy as np

import robot_file

# Factor to SI. Only the units that a robot file uses for the quantities read here.
_UNITS = {"rad": 1.0, "deg": np.pi / 180.0, "m": 1.0, "mm": 1e-3, "rad/s": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6,
          "Hz": 1.0, "Nm": 1.0, "Nm/rad": 1.0, "Nms/rad": 1.0, "kg": 1.0, "kgm2": 1.0}


def si(text):
    """'18 ms' -> 0.018. Raises ValueError on an unknown unit."""
    match = re.fullmatch(r"\s*([-+0-9.eE]+)\s+(\S+)\s*", str(text))
    if match is None or match.group(2) not in _UNITS:
        raise ValueError(f"'{text}' is no number with a unit among {sorted(_UNITS)}")
    value, factor = float(match.group(1)), _UNITS[match.group(2)]
    # Dividing by the exact 1000 keeps '18 ms' equal to the literal 0.018.
    return value / round(1.0 / factor) if factor in (1e-3, 1e-6) else value * factor


def _vector(texts):
    return np.array([si(text) for text in texts])


def _rotation_from_rpy(roll, pitch, yaw):
    cr, sr, cp, sp, cy, sy = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return rz @ ry @ rx


@dataclass
class Link:
    parent: int  # link index, -1: base
    origin: np.ndarray  # m
    rpy: np.ndarray  # rad
    axis: np.ndarray  # as written in the robot file

    def __post_init__(self):
        self.rotation = _rotation_from_rpy(*self.rpy)
        self.unit_axis = self.axis / np.linalg.norm(self.axis)


@dataclass
class Robot:
    names: list
    home: np.ndarray  # rad
    q_min: np.ndarray  # rad, position limit with its margin taken off
    q_max: np.ndarray
    velocity: np.ndarray  # rad/s
    links: list
    tool_link: int
    tool: np.ndarray  # m, in the tool link's frame
    policy: dict  # period, step_period (s), steps, input, output, terms [(name, sensor, scale, history)]
    camera: dict  # period, delay, jitter (s)
    target: dict  # centre, amplitude (m), frequency (Hz)

    @property
    def joints(self):
        return len(self.names)


def load(path):
    text = robot_file.read(path)
    joints, model, policy, simulation = text["joints"], text["model"], text["policy"], text["simulation"]
    margin = np.array([si(joint["limits"]["position_margin"]) for joint in joints])
    names = [joint["name"] for joint in joints]
    index = {"base": -1, **{name: i for i, name in enumerate(names)}}
    links = [Link(index[link["parent"]], _vector(link["origin"]["xyz"]),
                  _vector(link["origin"]["rpy"]), np.array(link["axis"], dtype=float)) for link in model["links"]]
    action = policy["action"]
    if [link["joint"] for link in model["links"]] != names or (action["kind"], action["offset"]) != ("joint_position", "home"):
        raise ValueError(f"{path}: expects one link per joint in joint order and actions relative to home")
    return Robot(
        names=names, home=_vector(joint["home"] for joint in joints),
        q_min=_vector(joint["limits"]["position"][0] for joint in joints) + margin,
        q_max=_vector(joint["limits"]["position"][1] for joint in joints) - margin,
        velocity=_vector(joint["limits"]["velocity"] for joint in joints), links=links,
        tool_link=index[model["tool"]["link"]], tool=_vector(model["tool"]["xyz"]),
        policy={"period": si(policy["period"]), "step_period": si(policy["step_period"]),
                "steps": int(policy["steps"]), "input": policy["input"], "output": policy["output"], "file": policy["file"], "scale": float(action["scale"]),
                "terms": [(term["term"], term.get("sensor", ""), float(term["scale"]), int(term["history"]))
                          for term in policy["observation"]]},
        camera={key: si(simulation["camera"][key]) for key in ("period", "delay", "jitter")},
        target={key: _vector(simulation["target"][key]) for key in ("centre", "amplitude", "frequency")})


def tool_and_jacobian(robot, q):
    """Tool position and its Jacobian for every row of q."""
    rotations, origins, axes = [], [], []
    for joint, link in enumerate(robot.links):
        parent_rotation = np.eye(3) if link.parent < 0 else rotations[link.parent]
        parent_origin = np.zeros(3) if link.parent < 0 else origins[link.parent]
        frame = parent_rotation @ link.rotation
        origins.append(parent_origin + parent_rotation @ link.origin)
        axes.append(frame @ link.unit_axis)
        x, y, z = link.unit_axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = q[:, joint, None, None]
        rotations.append(frame @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)))
    tool = origins[robot.tool_link] + rotations[robot.tool_link] @ robot.tool
    chain, link = set(), robot.tool_link
    while link >= 0:
        chain.add(link)
        link = robot.links[link].parent
    jacobian = np.zeros((len(q), 3, robot.joints))
    for joint in chain:
        jacobian[:, :, joint] = np.cross(np.broadcast_to(axes[joint], tool.shape), tool - origins[joint])
    return tool, jacobian


def tool_position(robot, q):
    return tool_and_jacobian(robot, q)[0]
