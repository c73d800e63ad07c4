# SPDX-License-Identifier: Apache-2.0
"""A batch of arms in closed loop: observation every policy period, chunk played out by interpolation, joints that trail
their setpoint like a first-order lag with bounded speed. Coarse on purpose: takt-plant is the judge of the result."""
from dataclasses import dataclass

import numpy as np

from arm_model import tool_position
from target import Camera
from teacher import Teacher

SUBSTEP = 0.005  # s, of the joints' motion
PUSH_LASTS = 0.5  # s
LONGEST_ABSENCE = 12  # camera periods


def observation(robot, q, dq, samples, last_action):
    """The input vector (batch, values), in the order of the robot file's observation terms."""
    columns = []
    for term, _, scale, history in robot.policy["terms"]:
        if term == "sensor":
            columns.append(scale * samples[:, -history:].reshape(len(q), -1))
        elif history != 1:
            raise ValueError(f"term {term}: training knows a history for the sensor only")
        else:
            columns.append(scale * {"joint_position_relative": q - robot.home, "joint_velocity": dq,
                                    "last_action": last_action}[term])
    return np.concatenate(columns, axis=1)


def sensor_history(robot):
    return max(history for term, _, _, history in robot.policy["terms"] if term == "sensor")


@dataclass
class Conditions:
    """How rough an episode is; zeros give the clean one used for evaluation."""
    camera_noise: float = 0.0005  # m
    push: float = 0.0  # rad, offset added to what the joints are told, redrawn every half second
    last_action_noise: float = 0.0  # rad
    wide_start: bool = False  # start poses all over the workspace, and arms that do not follow (not armed yet)
    lag: tuple = (0.02, 0.04)  # s
    interruption: float = 0.0  # chance per observation that the host was just restarted, or absent while the camera went on


def _start_poses(robot, rng, batch, wide):
    q = robot.home + rng.normal(0, 0.02, (batch, robot.joints))
    if wide:
        kind = rng.integers(0, 4, batch)
        q[kind == 0] = rng.normal(0, 0.1, (np.sum(kind == 0), robot.joints))
        spread = rng.uniform(-1, 1, (np.sum(kind == 1), robot.joints))
        q[kind == 1] = robot.home + 0.9 * spread
    return np.clip(q, robot.q_min, robot.q_max)


def _interrupt(camera, rng, share, last_action):
    """Restarts some hosts and keeps others from looking for a while; a host that restarts has forgotten its last action."""
    draw = rng.uniform(size=len(last_action))
    restarted = draw < 0.5 * share
    absent = np.where((draw < share) & ~restarted, rng.integers(1, LONGEST_ABSENCE, len(draw)), 0)
    camera.interrupt(restarted, absent)
    last_action[restarted] = 0.0


def roll_out(robot, targets, rng, duration, conditions, actor):
    """Runs `actor(observations, teacher_chunks) -> chunks` and returns observations, teacher's chunks and tool errors.

    Arrays are stacked over time first: (instants, batch, ...). Errors are taken at observation instants, in m.
    """
    batch, period, dt = len(targets.centre), robot.policy["period"], robot.policy["step_period"]
    camera = Camera(robot, targets, rng, duration, conditions.camera_noise, sensor_history(robot))
    substeps = int(round(period / SUBSTEP))
    teacher = Teacher(robot, targets, duration)
    q = _start_poses(robot, rng, batch, conditions.wide_start)
    dq, reference = np.zeros_like(q), q.copy()
    lag = rng.uniform(*conditions.lag, (batch, 1))
    asleep_until = np.where(rng.uniform(size=batch) < 0.25, rng.uniform(0, duration, batch), 0.0)
    if not conditions.wide_start:
        asleep_until[:] = 0.0
    last_action, push = np.zeros_like(q), np.zeros_like(q)
    seen, taught, errors = [], [], []
    for instant in range(int(round(duration / period))):
        time = instant * period
        errors.append(np.linalg.norm(tool_position(robot, q) - targets.at(time), axis=1))
        if conditions.interruption > 0:
            _interrupt(camera, rng, conditions.interruption, last_action)
        shown = last_action + rng.normal(0, 1, q.shape) * conditions.last_action_noise
        inputs = observation(robot, q, dq, camera.look(time), shown)
        lesson = teacher.chunk(time, q)
        seen.append(inputs.astype(np.float32))
        taught.append(lesson.astype(np.float32))
        chunk = actor(inputs, lesson)
        # The step due when the next observation is published: what a host calls the last action.
        last_action = chunk[:, min(int(round(period / dt)), chunk.shape[1] - 1)].copy()
        if instant % int(round(PUSH_LASTS / period)) == 0:
            push = rng.normal(0, 1, q.shape) * conditions.push * (rng.uniform(size=(batch, 1)) < 0.5)
        h = period / substeps
        for sub in range(substeps):
            position = (sub + 1) * h / dt
            step = min(int(position), chunk.shape[1] - 2)
            wanted = robot.home + push + chunk[:, step] + (position - step) * (chunk[:, step + 1] - chunk[:, step])
            reference = reference + np.clip(wanted - reference, -robot.velocity * h, robot.velocity * h)
            moved = np.clip(q + (reference - q) * (1 - np.exp(-h / lag)), robot.q_min, robot.q_max)
            awake = (time >= asleep_until)[:, None]
            reference = np.where(awake, reference, q)
            moved = np.where(awake, moved, q)
            dq, q = (moved - q) / h, moved
    return np.stack(seen), np.stack(taught), np.stack(errors)
