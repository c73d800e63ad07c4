# SPDX-License-Identifier: Apache-2.0
"""Moving targets and the camera that sees them: a batch of 3-D Lissajous curves, sampled late and with jitter."""
from dataclasses import dataclass

import numpy as np


@dataclass
class Targets:
    centre: np.ndarray  # (batch, 3) m
    amplitude: np.ndarray  # (batch, 3) m
    frequency: np.ndarray  # (batch, 3) Hz
    phase: np.ndarray  # (batch, 3) rad

    def at(self, time):
        """Positions (batch, 3) at `time` (scalar or one instant per row), seconds."""
        time = np.reshape(np.broadcast_to(time, len(self.centre)), (-1, 1))
        return self.centre + self.amplitude * np.sin(2 * np.pi * self.frequency * time + self.phase)


def random_targets(robot, rng, batch):
    """Curves spread around the robot file's own: what the policy is trained to follow."""
    nominal, shape = robot.target, (batch, 3)
    return Targets(centre=nominal["centre"] + rng.uniform(-0.04, 0.04, shape),
                   amplitude=nominal["amplitude"] * rng.uniform(0.4, 1.2, shape),
                   frequency=nominal["frequency"] * rng.uniform(0.5, 1.4, shape),
                   phase=rng.uniform(0, 2 * np.pi, shape))


def nominal_targets(robot, rng, batch):
    """The robot file's own curve, entered at a random instant of it."""
    nominal, start = robot.target, rng.uniform(0, 100, (batch, 1))
    ones = np.ones((batch, 1))
    return Targets(centre=ones * nominal["centre"], amplitude=ones * nominal["amplitude"],
                   frequency=ones * nominal["frequency"], phase=2 * np.pi * nominal["frequency"] * start)


class Camera:
    """What a policy host holds of the camera: the newest samples that had arrived when it looked, once per observation.

    History advances when an observation finds a new sample: a policy faster than the camera holds every sample, a slower
    one those that were newest at its observations. The episode begins in the middle of a host's life.
    """

    def __init__(self, robot, targets, rng, duration, noise, history):
        period, delay, jitter = (robot.camera[key] for key in ("period", "delay", "jitter"))
        looks = robot.policy["period"]
        # Starts early enough that the history is full by time zero.
        before = max(4, int(np.ceil(history * looks / period)) + 2)
        batch, count = len(targets.centre), int(duration / period) + before + 4
        first = -before * period + rng.uniform(0, period, batch)
        sensed = first[:, None] + period * np.arange(count)
        self._arrived = sensed + delay + rng.uniform(-jitter, jitter, sensed.shape)
        self._values = np.stack([targets.at(sensed[:, i]) for i in range(count)], axis=1)
        self._values += rng.normal(0, noise, self._values.shape)
        self._held = np.maximum(self._newest(-history * looks) - np.arange(history)[::-1], 0)
        for look in range(history, 0, -1):
            self.look(-look * looks)

    def _newest(self, time):
        """Index of the newest sample that has arrived (batch, 1)."""
        return np.maximum(np.sum(self._arrived <= time, axis=1, keepdims=True) - 1, 0)

    def look(self, time):
        """The history (batch, history, 3) that an observation at `time` finds, oldest first."""
        newest = self._newest(time)
        advanced = np.where(self._held[:, -1:] < 0, newest, np.concatenate([self._held[:, 1:], newest], axis=1))
        self._held = np.where(newest != self._held[:, -1:], advanced, self._held)
        return np.take_along_axis(self._values, self._held[:, :, None], axis=1)

    def interrupt(self, restarted, absent):
        """Before a look: hosts that `restarted` (batch) hold nothing, others were `absent` (batch) for so many samples."""
        self._held = np.maximum(self._held - absent[:, None], 0)
        self._held = np.where(restarted[:, None], -1, self._held)
