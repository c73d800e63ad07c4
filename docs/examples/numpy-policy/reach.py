#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The demo arm's tool follows the camera's target: inverse kinematics in numpy, in the place of a network."""
import numpy as np
import takt

# The arm of config/arm6.yaml: axis of each joint, and where the next one sits (m); the last offset is the tool's.
AXES = np.eye(3)[[2, 1, 1, 0, 1, 2]]
CROSS = [np.cross(np.eye(3), axis) for axis in AXES]
LINKS = np.array([(0, 0, .06), (0, 0, .28), (.24, 0, 0), (.06, 0, 0), (.05, 0, 0), (.08, 0, 0)])


def tool(q):
    """Where the tool is (m), and its Jacobian (m/rad)."""
    at, frame, joints, axes = np.array([0, 0, .08]), np.eye(3), [], []
    for angle, axis, cross, link in zip(q, AXES, CROSS, LINKS):
        joints.append(at)
        axes.append(frame @ axis)
        frame = frame @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
        at = at + frame @ link
    return at, np.cross(axes, at - joints).T


def solve(q, target):
    for _ in range(3):
        at, jacobian = tool(q)
        q = q + jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + 1e-3 * np.eye(3), target - at)
    return q


spec = takt.Policy(observation={"state": takt.joints("q", "dq"), "target": takt.stream("target", 3)},
                   action=takt.chunk("q", steps=16, step="10 ms"))
with takt.connect("robot.yaml", spec) as robot:
    seconds = robot.step * np.arange(robot.steps)[:, None]
    for obs in robot:
        with obs.infer():
            goal = solve(obs.state[0].astype(float), obs.target)
            path = obs.state[0] + np.clip(goal - obs.state[0], -1.5 * seconds, 1.5 * seconds)  # at most 1.5 rad/s
        obs.publish(q=path)
