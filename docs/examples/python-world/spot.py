# SPDX-License-Identifier: Apache-2.0
"""A world in Python that shows the robot something: a bright spot wanders before the demo arm's camera, and the arm is to turn after
it, as docs/examples/python-sensor/look.onnx does. docs/sensors.md. Usage: spot.py SOCKET"""
import math
import random
import sys

import numpy as np
from takt import world

INERTIA = np.array([0.15, 0.15, 0.08, 0.01, 0.01, 0.005])  # kg m2, of each joint
HEIGHT, WIDTH, SPOT = 48, 64, 8  # pixels
EVERY, SHUTTER = 0.033, 0.015  # s: an image is due, and how long ago its shutter was when it is there
TURN, REACH = 0.3, 0.5  # rad from one edge of the image to the other; m from the base's axis to the tool


class Spot:
    def reset(self, robot, seed, q):
        draw = random.Random(seed)
        self.frequency, self.phase = draw.uniform(0.05, 0.1), draw.uniform(0, 2 * math.pi)  # Hz, rad
        self.q, self.dq, self.time, self.due = q.copy(), np.zeros_like(q), 0.0, SHUTTER
        self.image = robot.images["cam0"]  # shared with Takt: drawn in place, not copied
        return self.state()

    def step(self, drive, seconds):
        # Without weight. What Takt does against an arm's lifts shoulder and elbow a little; the base, which is judged, bears none.
        damping = drive.viscous + drive.coulomb / np.maximum(np.abs(self.dq), 1e-4)
        self.dq = (INERTIA * self.dq + seconds * drive.torque) / (INERTIA + seconds * damping)
        self.q += seconds * self.dq
        self.time += seconds
        return self.state()

    def place(self, time):
        """Of the spot, from -1 to 1, left to right."""
        return 0.8 * math.sin(2 * math.pi * self.frequency * time + self.phase)

    def state(self):
        error = REACH * abs(self.q[0] - TURN / 2 * self.place(self.time))
        images = None
        if self.time >= self.due:
            self.due += EVERY
            self.image[:] = 16
            column = round((WIDTH - 1) * (1 + self.place(self.time - SHUTTER)) / 2 - SPOT / 2)
            self.image[20:20 + SPOT, column:column + SPOT] = 240
            images = {"cam0": world.Image(self.image, age=SHUTTER)}
        return world.State(self.q, self.dq, error=error, images=images)


if __name__ == "__main__":
    world.serve(Spot(), sys.argv[1], name="spot.py", error=True, cameras={"cam0": (HEIGHT, WIDTH, 1)})
