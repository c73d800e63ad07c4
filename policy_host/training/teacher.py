# SPDX-License-Identifier: Apache-2.0
"""The teacher: inverse kinematics of where the target will be, approached from where the arm is.

It sees the true future of the target; the network that imitates it must anticipate from camera samples.
"""
import numpy as np

from arm_model import tool_and_jacobian

DAMPING = 0.02  # m, of the least-squares step: keeps it bounded where the arm is stretched
HOME_PULL = 0.2  # share of the way to home taken per iteration in the null space, so that the answer is unique
JOINT_LAG = 0.025  # s, how far a joint trails its setpoint: the lead that makes the tool arrive in time
APPROACH_SPEED = 0.5  # of the joint's velocity limit
APPROACH_LEAD = 0.04  # s of approach speed by which the first step may already be ahead of the joint


def inverse_kinematics(robot, position, start, iterations):
    """Joint angles (batch, joints) near `start` that put the tool at `position` and stay as close to home as that allows."""
    q = start.copy()
    eye = np.eye(robot.joints)
    for _ in range(iterations):
        tool, jacobian = tool_and_jacobian(robot, q)
        transposed = np.transpose(jacobian, (0, 2, 1))
        inverse = transposed @ np.linalg.inv(jacobian @ transposed + DAMPING**2 * np.eye(3))
        reach = np.clip(position - tool, -0.1, 0.1)
        step = inverse @ reach[:, :, None] + HOME_PULL * (eye - inverse @ jacobian) @ (robot.home - q)[:, :, None]
        q = np.clip(q + step[:, :, 0], robot.q_min, robot.q_max)
    return q


class Teacher:
    """Knows the joint angles that reach the target at every step of an episode, `step_period` apart."""

    def __init__(self, robot, targets, duration):
        self._robot = robot
        self._dt = robot.policy["step_period"]
        self._steps = robot.policy["steps"]
        count = int(round(duration / self._dt)) + self._steps + 2
        batch = len(targets.centre)
        q = inverse_kinematics(robot, targets.at(JOINT_LAG), np.tile(robot.home, (batch, 1)), 80)
        self._reaching = np.empty((count, batch, robot.joints))
        for i in range(count):
            q = inverse_kinematics(robot, targets.at(i * self._dt + JOINT_LAG), q, 3)
            self._reaching[i] = q
        after = np.arange(self._steps)[:, None, None] * self._dt
        self._lead = APPROACH_SPEED * robot.velocity * (after + APPROACH_LEAD)

    def chunk(self, time, q):
        """Targets relative to home (batch, steps, joints) for an observation at `time` (s) with the arm at q."""
        first = int(time / self._dt + 1e-6)
        between = time / self._dt - first  # policy periods need not be whole numbers of steps
        before, after = (self._reaching[i:i + self._steps] for i in (first, first + 1))
        wanted = (before if abs(between) < 1e-6 else before + between * (after - before)) - q
        # Close to the target this is the target; far from it, a bounded lead over the joint.
        targets = q + self._lead * np.tanh(wanted / self._lead)
        targets = np.clip(targets, self._robot.q_min, self._robot.q_max)
        return np.transpose(targets - self._robot.home, (1, 0, 2))
