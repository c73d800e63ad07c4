# SPDX-License-Identifier: Apache-2.0
"""The robot file of a cart with a pole as training needs it, its dynamics for a whole batch at once, and the two
linear-quadratic regulators that come of it: the teacher's, which moves the cart, and the executive's fallback.

State (batch, 4): cart (rad of the pulley), pole (rad, 0 upright), and their speeds.
"""
from dataclasses import dataclass

import numpy as np

import robot_file
from arm_model import si

GRAVITY = 9.81
REST_SPEED = 0.05  # rad/s below which dry friction fades, so that a step of 1 ms stays smooth


@dataclass
class CartPole:
    radius: float  # m per rad of the cart's joint
    cart_inertia: float  # kg m^2 at the pulley, with the rotor and the pole's mass
    coupling: float  # kg m^2
    pole_inertia: float  # kg m^2 about the pivot
    gravity_moment: float  # Nm of the pole held level
    viscous: float
    coulomb: float
    pivot_viscous: float
    kp: float
    kd: float
    torque: float
    observer: float  # rad/s
    reach: float  # m
    policy: dict
    camera: dict
    facts: list  # every number above that the policy depends on, as the robot file has it


    def accelerations(self, state, torque):
        sine, cosine = np.sin(state[:, 1]), np.cos(state[:, 1])
        coupled = self.coupling * cosine
        speed = state[:, 2]
        rubbing = self.viscous * speed + self.coulomb * np.tanh(speed / REST_SPEED)
        first = torque - rubbing + self.coupling * sine * state[:, 3] ** 2
        second = self.gravity_moment * sine - self.pivot_viscous * state[:, 3]
        determinant = self.cart_inertia * self.pole_inertia - coupled ** 2
        return np.stack([self.pole_inertia * first - coupled * second,
                         self.cart_inertia * second - coupled * first], axis=1) / determinant[:, None]

    def step(self, state, torque, dt):
        speed = state[:, 2:] + dt * self.accelerations(state, torque)
        return np.concatenate([state[:, :2] + dt * speed, speed], axis=1)


def line(name, values):
    """One fact; the C++ test writes the same."""
    return " ".join([name] + [value if isinstance(value, str) else f"{value:.9g}" for value in values])


def facts_of(joints, policy, terms, machine, camera, target):
    lines = [line("joint", [cart_or_pole["name"], si(cart_or_pole["home"])]) for cart_or_pole in joints]
    cart = joints[0]
    lines.append(line("drive", [si(cart["gains"]["kp"]), si(cart["gains"]["kd"]), si(cart["limits"]["torque"]),
                                si(cart["inertia"])]))
    lines.append(line("cart_pole", [si(machine[key]) for key in ("pulley_radius", "cart_mass", "pole_mass", "pole_com",
                                                                 "pole_inertia")]))
    lines.append(line("policy", [si(policy["period"]), si(policy["step_period"]), str(policy["steps"]), policy["input"],
                                 policy["output"]]))
    lines += [line("term", [term, sensor or "-", scale]) for term, sensor, scale in terms]
    lines.append(line("camera", [camera[key] for key in ("period", "delay", "jitter")]))
    lines.append(line("steps", [si(target["reach"]), si(target["every"])]))
    return lines


def load(path):
    text = robot_file.read(path)
    joints, policy, simulation = text["joints"], text["policy"], text["simulation"]
    machine, cart = simulation["cart_pole"], joints[0]
    radius, pole, com = si(machine["pulley_radius"]), si(machine["pole_mass"]), si(machine["pole_com"])
    terms = [(term["term"], term.get("sensor", ""), float(term["scale"])) for term in policy["observation"]]
    if [term for term, _, _ in terms] != ["joint_position_relative", "joint_velocity", "sensor"]:
        raise ValueError(f"{path}: expects the observation terms position, velocity, sensor")
    camera = {key: si(simulation["camera"][key]) for key in ("period", "delay", "jitter")}
    return CartPole(
        radius=radius, cart_inertia=(si(machine["cart_mass"]) + pole) * radius ** 2 + si(cart["inertia"]),
        coupling=pole * com * radius, pole_inertia=si(machine["pole_inertia"]) + pole * com ** 2,
        gravity_moment=pole * GRAVITY * com, viscous=si(simulation["joint_friction"]["viscous"]),
        coulomb=si(simulation["joint_friction"]["coulomb"]), pivot_viscous=si(machine["pivot_viscous"]),
        kp=si(cart["gains"]["kp"]), kd=si(cart["gains"]["kd"]), torque=si(cart["limits"]["torque"]),
        observer=si(cart["observer_bandwidth"]), reach=si(simulation["target"]["reach"]),
        policy={"period": si(policy["period"]), "step_period": si(policy["step_period"]), "steps": int(policy["steps"]),
                "input": policy["input"], "output": policy["output"], "file": policy["file"],
                "scales": [scale for _, _, scale in terms], "scale": float(policy["action"]["scale"])},
        camera=camera, facts=facts_of(joints, policy, terms, machine, camera, simulation["target"]))


def regulator(a, b, weights, effort):
    """Gains (n) of u = -gains . x that minimise x' diag(weights) x + effort u^2, by the Hamiltonian's stable half."""
    size = len(a)
    hamiltonian = np.block([[a, -b @ b.T / effort], [-np.diag(weights), -a.T]])
    values, vectors = np.linalg.eig(hamiltonian)
    stable = vectors[:, values.real < 0]
    cost = np.real(stable[size:] @ np.linalg.inv(stable[:size]))
    return (b.T @ cost / effort)[0]


def fallback_gains(machine):
    """Of torque = -gains . (cart, pole, speeds), Nm per rad and rad/s: the executive's state feedback."""
    mass = np.linalg.inv([[machine.cart_inertia, machine.coupling], [machine.coupling, machine.pole_inertia]])
    a = np.zeros((4, 4))
    a[:2, 2:] = np.eye(2)
    a[2:, :2] = mass @ np.diag([0, machine.gravity_moment])
    a[2:, 2:] = -mass @ np.diag([machine.viscous, machine.pivot_viscous])
    b = np.zeros((4, 1))
    b[2:, 0] = mass[:, 0]
    scale = machine.radius ** 2
    return regulator(a, b, [3 * scale, 5, 0.1 * scale, 0.05], 0.2)
