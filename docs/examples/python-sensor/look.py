#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A policy that turns the arm's base after the bright spot of camera.py."""
import numpy as np

import takt

spec = takt.Policy(observation={"top": takt.image("cam0", shape=(48, 64, 1), max_age="100 ms"), "target": takt.stream("target", 3)},
                   action=takt.chunk("q", steps=16, step="10 ms"))
with takt.connect("robot.yaml", spec) as robot:
    goal = np.tile(robot.home, (robot.steps, 1))
    for obs in robot:
        with obs.infer():
            column = np.argmax(obs.top.sum(axis=0))    # of the brightest column
            goal[:, 0] = robot.home[0] + 0.3 * (column / 63 - 0.5)
        obs.publish(q=goal)
