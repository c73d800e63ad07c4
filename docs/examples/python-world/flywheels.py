# SPDX-License-Identifier: Apache-2.0
"""A world in Python: every drive turns a flywheel. docs/world-protocol.md. Usage: flywheels.py SOCKET"""
import sys

import numpy as np
from takt import world

INERTIA = 0.1  # kg m2, of each


class Flywheels:
    def reset(self, robot, seed, q):
        self.q, self.dq = q.copy(), np.zeros_like(q)
        return world.State(self.q, self.dq)

    def step(self, drive, seconds):
        # Friction is implicit, so that any step is stable against it and a held wheel stays where it is.
        damping = drive.viscous + drive.coulomb / np.maximum(np.abs(self.dq), 1e-4)
        self.dq = (INERTIA * self.dq + seconds * drive.torque) / (INERTIA + seconds * damping)
        self.q += seconds * self.dq
        return world.State(self.q, self.dq)


if __name__ == "__main__":
    world.serve(Flywheels(), sys.argv[1], name="flywheels")
