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
    """What a policy host holds of the camera at an instant: the newest `history` samples that have arrived by then.

    History advances once per new sample, not once per observation, and starts filled with the first sample.
    """

    def __init__(self, robot, targets, rng, duration, noise):
        period, delay, jitter = (robot.camera[key] for key in ("period", "delay", "jitter"))
        batch, count = len(targets.centre), int(duration / period) + 8
        # Starts early enough that a sample has arrived by time zero.
        first = -4 * period + rng.uniform(0, period, batch)
        sensed = first[:, None] + period * np.arange(count)
        self._arrived = sensed + delay + rng.uniform(-jitter, jitter, sensed.shape)
        self._values = np.stack([targets.at(sensed[:, i]) for i in range(count)], axis=1)
        self._values += rng.normal(0, noise, self._values.shape)

    def newest(self, time, history):
        """(batch, history, 3), oldest first."""
        newest = np.sum(self._arrived <= time, axis=1) - 1
        picks = np.maximum(newest[:, None] - np.arange(history)[::-1], 0)
        return np.take_along_axis(self._values, picks[:, :, None], axis=1)
