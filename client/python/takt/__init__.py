"""Takt for policies in Python: read a robot's observations, answer them with chunks of joint targets.

    import takt

    spec = takt.Policy(observation={"state": takt.joints("q", "dq"), "target": takt.stream("target", 3)},
                       action=takt.chunk("q", steps=16, step="10 ms"))
    with takt.connect("robot.yaml", spec) as robot:
        for obs in robot:
            with obs.infer():
                actions = net(obs.state, obs.target)
            obs.publish(q=actions)

Joints are those of the robot file, in its order (`robot.joints`). Units: q rad, dq rad/s, tau Nm, kp Nm/rad, kd Nms/rad;
stamps in ns of the clock of time.monotonic_ns(). Arrays are float32. Everything belongs to the thread that connected.
"""
from takt._policy import Chunk, Joints, Observation, Policy, Robot, Stream, chunk, connect, joints, stream
from takt._refused import Refused

__all__ = ["Chunk", "Joints", "Observation", "Policy", "Refused", "Robot", "Stream", "chunk", "connect", "joints", "stream"]
