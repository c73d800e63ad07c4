#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""A policy whose answers come from the server at TAKT_TEST_SERVER: it asks with the observation's number, and publishes what comes for that very
observation. This machine's clock of the day jumps by days all the while. The robot file's steps, and a deadline of two thirds of max_age.
"""
import itertools
import os
import time

import takt
from takt import servers

STEPS, DEADLINE = 32, "200 ms"


def server_of(url, robot):
    shape = (robot.steps, len(robot.joints))
    if url.startswith("tcp:"):
        return servers.Groot(url, shape=shape, deadline=DEADLINE, actions=("action.arm",))
    return servers.OpenPi(url, shape=shape, deadline=DEADLINE)


jumps = itertools.cycle((-3e7, 1e5, 3e7, -1e9))
time.time = lambda real=time.time: real() + next(jumps)
spec = takt.Policy(observation={"state": takt.joints("q", "dq"), "target": takt.stream("target", 3)},
                   action=takt.chunk("q", steps=STEPS, step="10 ms"))
with takt.connect("robot.yaml", spec) as robot, server_of(os.environ["TAKT_TEST_SERVER"], robot) as server:
    for obs in robot:
        with obs.infer():
            q = server.infer({"n": obs.id, "home": robot.home, "state": obs.state, "target": obs.target})
        if q is not None:
            obs.publish(q=q)
