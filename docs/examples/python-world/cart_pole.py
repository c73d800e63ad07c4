# SPDX-License-Identifier: Apache-2.0
"""A world in Python that judges: config/cart_pole.yaml's cart and pole, and where the cart is wanted. docs/world-protocol.md.
Usage: cart_pole.py SOCKET"""
import math
import random
import sys

import numpy as np
from takt import world

RADIUS, CART, POLE, COM, INERTIA, ROTOR, PIVOT = 0.05, 1.0, 0.2, 0.3, 0.006, 0.002, 0.0005  # m, kg, kg, m, kg m2, kg m2, Nm s/rad
COUPLING, WEIGHT = POLE * COM * RADIUS, POLE * 9.81 * COM
SUB_STEPS, CAMERA, REACH, EVERY, FALLEN = 4, 0.020, 0.3, 3.0, 0.6  # -, s, m, s, rad


class CartPole:
    def reset(self, robot, seed, q):
        if robot.joints != ("cart", "pole"):
            raise ValueError(f"{robot.name} is no cart with a pole")
        self.random = random.Random(seed)
        self.q, self.dq = np.array(q), np.zeros(2)  # pulley, pole: rad
        self.time, self.seen_at, self.wanted, self.next_wish = 0.0, -CAMERA, 0.0, self.random.uniform(0, EVERY)
        return self.state()

    def step(self, drive, seconds):
        dt = seconds / SUB_STEPS
        for _ in range(SUB_STEPS):
            sine, cosine = math.sin(self.q[1]), math.cos(self.q[1])
            mass = np.array([[(CART + POLE) * RADIUS**2 + ROTOR, COUPLING * cosine], [COUPLING * cosine, INERTIA + POLE * COM**2]])
            bias = np.array([-COUPLING * sine * self.dq[1] ** 2, -WEIGHT * sine])
            damping = drive.viscous + drive.coulomb / np.maximum(np.abs(self.dq), 1e-4) + [0, PIVOT]
            self.dq = np.linalg.solve(mass + dt * np.diag(damping), mass @ self.dq + dt * (drive.torque - bias))
            self.q += dt * self.dq
        self.time += seconds
        if self.time >= self.next_wish:
            self.wanted, self.next_wish = self.random.uniform(-REACH, REACH), self.next_wish + EVERY
        return self.state()

    def state(self):
        if abs(self.q[1]) > FALLEN:
            return world.State(self.q, self.dq, outcome=world.FAILED, reason="the pole fell")
        seen = self.time >= self.seen_at + CAMERA
        if seen:
            self.seen_at += CAMERA
        error = abs(RADIUS * self.q[0] - self.wanted)
        return world.State(self.q, self.dq, error=error, sensor=[self.wanted] if seen else None)


if __name__ == "__main__":
    world.serve(CartPole(), sys.argv[1], name="cart_pole.py", error=True, sensor=("target", 1))
