# SPDX-License-Identifier: Apache-2.0
"""A pendulum as a world of Takt's: 2 kg at 0.5 m below a hinge about y. Usage: pendulum.py SOCKET memory|socket"""
import importlib.util
import math
import pathlib
import sys

import numpy as np

# The module alone: the package around it wants libtakt-client, a world does not.
path = pathlib.Path(__file__).resolve().parents[3] / "client/python/takt/world.py"
spec = importlib.util.spec_from_file_location("world", path)
world = importlib.util.module_from_spec(spec)
sys.modules["world"] = world
sys.dont_write_bytecode = True
spec.loader.exec_module(world)

MASS, LENGTH, GRAVITY, SUB_STEPS = 2.0, 0.5, 9.81, 2


class Pendulum:
    def reset(self, robot, seed, q):
        if len(robot.joints) != 1:
            raise ValueError(f"{robot.name} has {len(robot.joints)} joints, a pendulum one")
        self.q, self.dq = float(q[0]), 0.0
        return self.state()

    def step(self, drive, seconds):
        dt, inertia = seconds / SUB_STEPS, MASS * LENGTH**2
        for _ in range(SUB_STEPS):
            damping = drive.viscous[0] + drive.coulomb[0] / max(abs(self.dq), 1e-4)
            gravity = MASS * GRAVITY * LENGTH * math.sin(self.q)
            self.dq = (inertia * self.dq + dt * (drive.torque[0] - gravity)) / (inertia + dt * damping)
            self.q += dt * self.dq
        if abs(self.q) > 3:
            return world.State(self.q, self.dq, outcome=world.FAILED, reason="over the top")
        return self.state()

    def state(self):
        return world.State(np.array([self.q]), np.array([self.dq]), point=(-LENGTH * math.sin(self.q), 0, -LENGTH * math.cos(self.q)))


if __name__ == "__main__":
    world.serve(Pendulum(), sys.argv[1], name="pendulum.py", point=True, shared_memory=sys.argv[2] == "memory")
