# SPDX-License-Identifier: Apache-2.0
"""The robot file of the robot on two wheels and its MJCF as training needs them, and the dynamics for a whole batch at once, which can be
differentiated. Wheels do not slip; the base neither slides nor rolls sideways.

State (batch, 4): forward speed m/s, tilt forward rad, tilt rate rad/s, turning rate to the left rad/s.
"""
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass

import torch

import robot_file
from arm_model import si
from cart_pole_model import GRAVITY, line


@dataclass
class Balancer:
    mass: float  # kg, of the body
    height: float  # m, of its centre of mass above the axle
    tilt_inertia: float  # kg m^2, of the body about its centre of mass
    turn_inertia: float  # kg m^2, of all of it, as the wheels feel it
    wheel_mass: float  # kg, of one, with what its spinning adds
    rotor: float  # kg m^2, of one, between body and wheel
    radius: float  # m
    half_track: float  # m
    kd: float  # Nms/rad
    torque: float  # Nm
    policy: dict
    facts: list  # every number above that the policy depends on, as its file has it

    def wheel_speeds(self, state):
        """(batch, 2): left, right; rad/s against the body."""
        speed, _, tilting, turning = state.unbind(1)
        left, right = speed - self.half_track * turning, speed + self.half_track * turning
        return torch.stack([left, right], 1) / self.radius - tilting[:, None]

    def step(self, state, wanted, heavier, dt):
        """`wanted` (batch, 2): rad/s that the drives are told; `heavier` (batch): factor on the body's mass."""
        speed, tilt, tilting, turning = state.unbind(1)
        torques = torch.clip(self.kd * (wanted - self.wheel_speeds(state)), -self.torque, self.torque)
        torque, mass = torques.sum(1), self.mass * heavier
        sine, cosine = torch.sin(tilt), torch.cos(tilt)
        a = mass + 2 * self.wheel_mass + 2 * self.rotor / self.radius ** 2
        b = mass * self.height * cosine - 2 * self.rotor / self.radius
        c = self.tilt_inertia + mass * self.height ** 2 + 2 * self.rotor
        first = torque / self.radius + mass * self.height * sine * tilting ** 2
        second = mass * GRAVITY * self.height * sine - torque
        determinant = a * c - b * b
        tilting = tilting + dt * (a * second - b * first) / determinant
        turned = (torques[:, 1] - torques[:, 0]) * self.half_track / self.radius / self.turn_inertia
        return torch.stack([speed + dt * (c * first - b * second) / determinant, tilt + dt * tilting, tilting, turning + dt * turned], 1)

    def observation(self, state, command):
        """As the robot file lists it: angular velocity, projected gravity, wheel speeds, command."""
        nothing = torch.zeros(len(state))
        turning, gravity, wheels, asked = self.policy["scales"]
        angular = torch.stack([nothing, state[:, 2], state[:, 3]], 1)  # of a base that is nearly upright
        down = torch.stack([torch.sin(state[:, 1]), nothing, -torch.cos(state[:, 1])], 1)
        return torch.cat([turning * angular, gravity * down, wheels * self.wheel_speeds(state), asked * command], 1)


def load(path):
    text = robot_file.read(path)
    policy, joint = text["policy"], text["joint_defaults"][0]
    terms = [(term["term"], term.get("sensor", ""), float(term["scale"])) for term in policy["observation"]]
    if [term for term, _, _ in terms] != ["base_angular_velocity", "projected_gravity", "joint_velocity", "command"]:
        raise ValueError(f"{path}: expects the observation terms base_angular_velocity, projected_gravity, joint_velocity, command")
    limits = next(sensor["command"] for sensor in text["sensors"] if sensor["name"] == terms[-1][1])
    body = ElementTree.parse(path.parent / text["simulation"]["mujoco"]["model"]).find("worldbody/body")
    numbers = {name: [float(value) for value in element.get(key).split()] for name, element, key in (
        ("mass", body.find("inertial"), "mass"), ("inertia", body.find("inertial"), "diaginertia"), ("wheel", body.find("body"), "pos"),
        ("wheel_mass", body.find("body/inertial"), "mass"), ("wheel_inertia", body.find("body/inertial"), "diaginertia"),
        ("armature", body.find("body/joint"), "armature"), ("size", body.find("body/geom"), "size"))}
    radius, half_track, spin = numbers["size"][0], numbers["wheel"][1], numbers["wheel_inertia"][1]
    rolling, rotor = numbers["wheel_mass"][0] + spin / radius ** 2, numbers["armature"][0]
    facts = [line(name, values) for name, values in numbers.items()]
    facts.append(line("drive", [si(joint["gains"]["kd"]), si(joint["limits"]["torque"])]))
    facts.append(line("policy", [si(policy["period"]), policy.get("input", "obs"), policy.get("output", "actions"),
                                 float(policy["action"]["scale"])]))
    facts += [line("term", [term, sensor or "-", scale]) for term, sensor, scale in terms]
    facts.append(line("command", [float(value) for value in limits["minimum"] + limits["maximum"]]))
    return Balancer(
        mass=numbers["mass"][0], height=-numbers["wheel"][2], tilt_inertia=numbers["inertia"][1],
        turn_inertia=numbers["inertia"][2] + 2 * numbers["wheel_inertia"][0] + 2 * (rolling + rotor / radius ** 2) * half_track ** 2,
        wheel_mass=rolling, rotor=rotor, radius=radius, half_track=half_track, kd=si(joint["gains"]["kd"]), torque=si(joint["limits"]["torque"]),
        policy={"period": si(policy["period"]), "input": policy.get("input", "obs"), "output": policy.get("output", "actions"),
                "file": policy["file"], "scale": float(policy["action"]["scale"]), "scales": [scale for _, _, scale in terms],
                "minimum": limits["minimum"], "maximum": limits["maximum"]},
        facts=facts)
