# SPDX-License-Identifier: Apache-2.0
"""Takt in Python: policies, sensors, and what runs leave behind. A policy reads a robot's observations, and answers them with chunks of joint targets:

    import takt

    spec = takt.Policy(observation={"state": takt.joints("q", "dq"), "target": takt.stream("target", 3)},
                       action=takt.chunk("q", steps=16, step="10 ms"))
    with takt.connect("robot.yaml", spec) as robot:
        for obs in robot:
            with obs.infer():
                actions = net(obs.state, obs.target)
            obs.publish(q=actions)

A sensor publishes what it senses, into shared memory, with the stamp of its own instant:

    with takt.Sensor("target", "robot.yaml", shape=3, unit="m") as sensor:
        sensor.publish(position, stamp=time.monotonic_ns())

A policy that goes on from what is being played (real-time chunking) says join="rtc", and is shown it as obs.committed.

takt.open(FOLDER) reads a run or a panel's artifact as tables of pandas.

A policy that infers on another machine is a client of its server: see takt.servers.

Joints are those of the robot file, in its order (`robot.joints`). Units: q rad, dq rad/s, tau Nm, kp Nm/rad, kd Nms/rad;
of a slide m, m/s, N, N/m, Ns/m; stamps in ns of the clock of time.monotonic_ns(). Arrays are float32. Everything belongs to the thread that connected.
"""
from takt._policy import Alternatives, Assumption, Chunk, Image, Joints, Observation, Policy, Queue, Robot, Stream, chunk, connect, image, joints, queue, stream
from takt._refused import Refused
from takt._run import Artifact, Run, open
from takt._sensor import Sensor

__all__ = ["Alternatives", "Artifact", "Assumption", "Chunk", "Image", "Joints", "Observation", "Policy", "Queue", "Refused", "Robot", "Run", "Sensor", "Stream", "chunk", "connect", "image", "joints", "open", "queue", "stream"]
