#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fits a policy that denoises its chunks (docs/flow-policies.md) to demonstrations of an arm that follows a moving target in either of two
postures, one as good as the other: a joint (--lane) turned by up to --reach to one side or the other of where it would be by itself, the
other joints keeping the tool on the target.

Which posture the demonstrator goes to, at --rate of the whole way from the middle per second, it decides anew with every plan that is free
from its first step; one that must begin with steps of the plan before, which are being played already, goes on to where that was going.

What is learned, by gradient descent, are the demonstrator's joint angles over the chunk's time in the middle and either posture, as
polynomials of time and of the way between the postures, from the target's last positions. How far apart these lie it is not told, and
answers may be asked for rarely: it must know the curve. The rest is closed form, as the demonstrator's own: the way from where the arm is,
or where the prefix ends, and the velocity of the flow that turns noise into one of two plans. Plan m has the weight
exp(-|x - t plan_m|^2 / 2 (1 - t)^2), so far as x is free; of a prefix, whose time is 1, the exponent is how far its way between the
postures lies from going to posture m all along.

Reproducible: one thread, one seed, no time in the output file. Writes the ONNX file and a report beside the robot file; the committed
reports hold the command of each network.

    nice -n 19 /usr/bin/python3 policy_host/training/make_arm_flow.py --robot config/arm6_flow.yaml --lane wrist_roll --reach 1.2
"""
import argparse
import hashlib
import json
import platform
import sys
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import TensorProto, helper

import arm_model
import network
import robot_file
from make_flow import Graph
from target import nominal_targets
from teacher import APPROACH_LEAD, DAMPING, HOME_PULL, JOINT_LAG, inverse_kinematics
from train_reach import facts, fit

HIDDEN, NODES = 96, 5  # of the network; of the polynomials of time, as many values as coefficients
SPACING = (0.033, 0.27)  # s, between two samples of a history: the camera's period, and what a slow policy makes of it
APPROACH_SPEED = 1.0  # of the joint's velocity limit, of an arm that is far from where its plan goes
NOISE = 0.0005  # m, of a sample
SHORT_HISTORY = 0.05  # share of samples whose history has just begun
FADE = 0.1  # s, in which what a prefix's end is off the new plan falls to a share of 1 / e
NEAREST = 0.05  # of 1 - t: for up to 20 steps of denoising
PREFIX_SPREAD = 0.02  # of the way from the middle to a posture: how far a prefix's step lies from going there


class Arm:
    """The robot file, and what of it the closed form needs."""

    def __init__(self, path, lane, reach, rate):
        self.robot = arm_model.load(path)
        policy = self.robot.policy
        self.steps, self.dt, self.scale = policy["steps"], policy["step_period"], policy["scale"]
        self.joints, self.lane, self.reach, self.rate = self.robot.joints, self.robot.names.index(lane), reach, rate
        self.history = dict((term, history) for term, _, _, history in policy["terms"])["sensor"]
        longest = arm_model.si(robot_file.read(path)["policy"]["action"]["join"]["longest"])
        self.longest = int(round(longest / self.dt)) + 2  # steps of a prefix: one begun, and one more
        if [term for term, _, _, _ in policy["terms"]] != ["joint_position_relative", "sensor"]:
            raise ValueError(f"{path}: expects observations of joint_position_relative and sensor")
        self.times = np.arange(self.steps) * self.dt
        nodes = 0.5 * self.times[-1] * (1 - np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES))
        self.nodes = nodes
        others = [np.delete(nodes, i) for i in range(NODES)]
        self.basis = np.stack([np.prod((self.times[:, None] - other) / (nodes[i] - other), axis=1)
                               for i, other in enumerate(others)], axis=1)  # (steps, nodes)
        self.approach = APPROACH_SPEED * self.robot.velocity * (self.times[:, None] + APPROACH_LEAD)  # rad, (steps, joints)
        # By length of the prefix: time since its last step, what fades since then, which step counts as where the way begins.
        self.since = np.zeros((self.longest + 1, self.steps))
        self.fade, self.begin = np.zeros_like(self.since), np.zeros_like(self.since)
        self.since[0], self.begin[0, 0] = self.times + APPROACH_LEAD, 1
        for length in range(1, self.longest + 1):
            self.since[length] = np.maximum(self.times - self.times[length - 1], 0)
            self.fade[length] = np.exp(-self.since[length] / FADE)
            self.begin[length, length - 1] = 1


def postures(arm, position):
    """Joint angles (3, batch, joints), relative to home, that put the tool at `position`: in the middle, to one side, to the other."""
    robot, count = arm.robot, len(position)
    middle = inverse_kinematics(robot, position, np.tile(robot.home, (count, 1)), 30)
    found, eye = [middle], np.eye(robot.joints)
    for side in (-1, 1):
        q = middle.copy()
        q[:, arm.lane] += side * arm.reach
        rest = q.copy()
        for _ in range(20):
            tool, jacobian = arm_model.tool_and_jacobian(robot, q)
            jacobian[:, :, arm.lane] = 0  # held
            transposed = np.transpose(jacobian, (0, 2, 1))
            inverse = transposed @ np.linalg.inv(jacobian @ transposed + DAMPING**2 * np.eye(3))
            step = inverse @ (position - tool)[:, :, None] + 0.2 * HOME_PULL * (eye - inverse @ jacobian) @ (rest - q)[:, :, None]
            q = np.clip(q + step[:, :, 0], robot.q_min, robot.q_max)
        found.append(q)
    return np.stack(found) - robot.home


def collect(arm, rng, count):
    """Histories (count, 3 * samples), and polynomials (count, 3 * nodes * joints): the middle, the way's first and second power."""
    robot = arm.robot
    targets = nominal_targets(robot, rng, count)
    delay, period, jitter = robot.camera["delay"], robot.camera["period"], robot.camera["jitter"]
    sensed = -(delay + rng.uniform(-jitter, jitter, count) + rng.uniform(0, period, count))
    spacing, samples = rng.uniform(*SPACING, count), []
    begun = np.where(rng.uniform(size=count) < SHORT_HISTORY, rng.integers(1, arm.history, count), arm.history)
    for i in range(arm.history):
        samples.append(targets.at(sensed) + rng.normal(0, NOISE, (count, 3)))
        if i > 0:
            samples[-1] = np.where((i >= begun)[:, None], samples[-2], samples[-1])
        sensed = sensed - np.maximum(spacing + rng.uniform(-period, period, count), period)
    inputs = np.concatenate(samples[::-1], axis=1)
    found = np.stack([postures(arm, targets.at(node + JOINT_LAG)) for node in arm.nodes], axis=2)  # 3, count, nodes, joints
    middle, left, right = found
    parts = np.stack([middle, 0.5 * (right - left), 0.5 * (right + left) - middle], axis=1)
    return inputs, parts.reshape(count, -1)


def train(arm, seed, samples, steps):
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    inputs, wanted = collect(arm, rng, samples)
    model = network.build(inputs.shape[1], wanted.shape[1], HIDDEN)
    normaliser = network.Normaliser(inputs, wanted, [(3 * i, 3) for i in range(arm.history)])
    optimiser = torch.optim.Adam(model.parameters(), lr=2e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    loss = fit(model, optimiser, schedule, torch.from_numpy(normaliser.features(inputs)), torch.from_numpy(normaliser.outputs(wanted)), steps, rng)
    layers = network.folded_layers(model, normaliser)
    # The joint that makes the difference makes it exactly.
    weight, bias = (values.reshape(3, NODES, arm.joints, *values.shape[1:]) for values in layers[-1])
    weight[1:, :, arm.lane], bias[1, :, arm.lane], bias[2, :, arm.lane] = 0, arm.reach, 0
    # The first layer takes the whole observation.
    first = np.concatenate([np.zeros((HIDDEN, arm.joints), np.float32), layers[0][0]], axis=1)
    layers[0] = (first, layers[0][1])
    print("rms, rad, of the last steps:", float(np.sqrt(loss)) * normaliser.spread, flush=True)
    return layers, float(np.sqrt(loss)) * normaliser.spread


class Plans:
    """What the ONNX file computes (float64). Rows share the length of their prefix; chunks are (batch, steps, joints), in outputs."""

    def __init__(self, arm, layers):
        self.arm, self.layers = arm, layers

    def paths(self, observation):
        """The middle's angles, and the way's first and second power: (3, batch, steps, joints), rad."""
        parts = network.evaluate(self.layers, observation).reshape(len(observation), 3, NODES, self.arm.joints)
        return np.moveaxis(np.einsum("sn,bpnj->bpsj", self.arm.basis, parts), 1, 0)

    def plans(self, observation, x, length):
        """Both plans (2, batch, steps, joints), and of each the squared distance of the prefix from going there (2, batch)."""
        arm, (middle, first, second) = self.arm, self.paths(observation)
        base = observation[:, :arm.joints] if length == 0 else x[:, length - 1] * arm.scale
        begin = max(length - 1, 0)
        way = np.clip((base[:, arm.lane] - middle[:, begin, arm.lane]) / arm.reach, -1, 1)[:, None]
        there = middle[:, begin] + way * first[:, begin] + way**2 * second[:, begin]
        prefix = (x[:, :length, arm.lane] * arm.scale - middle[:, :length, arm.lane]) / arm.reach
        made, apart = [], []
        for side in (-1, 1):
            ways = np.clip(way + side * arm.rate * arm.since[length], -1, 1)[:, :, None]
            plan = middle + ways * first + ways**2 * second
            if length == 0:
                plan = base[:, None] + arm.approach * np.tanh((plan - base[:, None]) / arm.approach)
            else:
                plan = plan + arm.fade[length][:, None] * (base - there)[:, None]
            made.append(plan / arm.scale)
            start = np.clip(prefix[:, :1], -1, 1)
            along = np.clip(start + side * arm.rate * arm.times[:length], -1, 1) - start
            apart.append((((prefix - prefix[:, :1] - along) / PREFIX_SPREAD) ** 2).sum(axis=1))
        return np.stack(made), np.stack(apart)

    def velocity(self, observation, x, time):
        """`time` (steps)."""
        length = int((time >= 1).sum())
        left = np.maximum(1 - time, NEAREST)[:, None]
        plans, apart = self.plans(observation, x, length)
        free = ((x - time[:, None] * plans) / left) * (time < 1)[:, None]
        logits = -0.5 * ((free**2).sum(axis=(2, 3)) + apart)
        right = 1 / (1 + np.exp(np.clip(logits[0] - logits[1], -80, 80)))
        return (plans[0] + right[:, None, None] * (plans[1] - plans[0]) - x) / left

    def sample(self, observation, rng, prefix, length, denoising=8):
        x = rng.normal(0, 1, (len(observation), self.arm.steps, self.arm.joints))
        for i in range(denoising):
            time = np.full(self.arm.steps, i / denoising)
            time[:length], x[:, :length] = 1.0, prefix[:, :length]
            x = x + self.velocity(observation, x, time) / denoising
        x[:, :length] = prefix[:, :length]
        return x


def onnx_bytes(arm, layers):
    """Rows of a matrix are the chunk's steps, columns its joints."""
    graph, steps, joints = Graph(), arm.steps, arm.joints
    number, do = graph.number, graph.do

    def shaped(name, rows, columns, output):
        shape = f"shape.{rows}.{columns}"
        graph.shape(shape, [rows, columns])
        return do("Reshape", [name, shape], output)

    def times(a, b, output):
        return do("MatMul", [a, b], output)

    def between(name, output):
        return do("Min", [do("Max", [name, "minus.one"], f"{output}.most"), "one"], output)

    for name, value in (("one", 1), ("minus.one", -1), ("nothing", 0), ("steep", 1e4), ("threshold", 1e4 - 1), ("nearest", NEAREST), ("scale", arm.scale),
                        ("reach", arm.reach), ("half", -0.5), ("spread", PREFIX_SPREAD)):
        number(name, [[value]])
    shaped("x_t", steps, joints, "x")
    shaped("t", steps, 1, "time")
    # Of each step, whether it is kept: its time is 1, that of the others at most 1 - 1 / (steps of denoising).
    do("Max", [do("Sub", [do("Mul", ["time", "steep"], "time.steep"), "threshold"], "time.over"), "nothing"], "kept")
    do("Sub", ["one", "kept"], "free")
    do("Max", [do("Sub", ["one", "time"], "left.exact"), "nearest"], "left")
    # The prefix has length d where step d - 1 is kept and step d is not.
    ends = np.zeros((steps, arm.longest + 1))
    for length in range(arm.longest + 1):
        if length > 0:
            ends[length - 1, length] += 1
        ends[length, length] -= 1
    alone = np.eye(1, arm.longest + 1)
    do("Add", [times(shaped("kept", 1, steps, "kept.row"), number("ends", ends), "length.change"), number("alone", alone)], "length")
    times("length", number("no.prefix", alone.T), "fresh")
    do("Sub", ["one", "fresh"], "continued")
    # The network's polynomials at every step.
    flowing = "obs"
    for i, (weight, bias) in enumerate(layers[:-1]):
        do("Gemm", [flowing, number(f"layer{i}.weight", weight), number(f"layer{i}.bias", bias)], f"layer{i}.linear", transB=1)
        flowing = do("Elu", [f"layer{i}.linear"], f"layer{i}.out", alpha=1.0)
    size = NODES * joints
    for i, name in enumerate(("middle", "first", "second")):
        weight, bias = (values[i * size:(i + 1) * size] for values in layers[-1])
        do("Gemm", [flowing, number(f"{name}.weight", weight), number(f"{name}.bias", bias)], f"{name}.values", transB=1)
        times(number("basis", arm.basis) if i == 0 else "basis", shaped(f"{name}.values", NODES, joints, f"{name}.nodes"), name)
    lane = np.zeros((joints, 1))
    lane[arm.lane] = 1
    times("middle", number("lane", lane), "middle.lane")
    # Where the way begins: the prefix's last step, or where the arm is.
    see = np.zeros((joints + 3 * arm.history, joints))
    see[:joints] = np.eye(joints)
    last = arm.begin.copy()
    last[0] = 0
    times(times("length", number("last", last), "last.step"), "x", "base.outputs")
    do("Mul", ["base.outputs", "scale"], "base.prefix")
    do("Mul", [times("obs", number("see", see), "seen"), "fresh"], "base.seen")
    do("Add", ["base.prefix", "base.seen"], "base")
    times("length", number("begin", arm.begin), "begin.step")
    do("Sub", [times("base", "lane", "base.lane"), times("begin.step", "middle.lane", "begin.lane")], "base.off")
    between(do("Div", ["base.off", "reach"], "way.whole"), "way")
    do("Mul", ["way", "way"], "way.squared")
    do("Mul", [times("begin.step", "first", "begin.first"), "way"], "there.first")
    do("Mul", [times("begin.step", "second", "begin.second"), "way.squared"], "there.second")
    do("Add", [do("Add", [times("begin.step", "middle", "begin.middle"), "there.first"], "there.part"), "there.second"], "there")
    shaped(times("length", number("fades", arm.fade), "fade.row"), steps, 1, "fade")
    do("Mul", ["fade", do("Sub", ["base", "there"], "off")], "fading")
    number("approach", arm.approach)
    # How the prefix went between the postures.
    do("Sub", [do("Mul", [times("x", "lane", "x.lane"), "scale"], "x.lane.rad"), "middle.lane"], "x.off")
    do("Div", ["x.off", "reach"], "x.way")
    times(number("first.step", np.eye(1, steps)), "x.way", "x.start")
    between("x.start", "start")
    do("Sub", ["x.way", "x.start"], "x.along")
    for name, side in (("a", -1), ("b", 1)):
        shaped(times("length", number(f"{name}.since", side * arm.rate * arm.since), f"{name}.gone.row"), steps, 1, f"{name}.gone")
        between(do("Add", ["way", f"{name}.gone"], f"{name}.way.whole"), f"{name}.way")
        do("Mul", [f"{name}.way", f"{name}.way"], f"{name}.way.squared")
        do("Mul", [f"{name}.way", "first"], f"{name}.first")
        do("Mul", [f"{name}.way.squared", "second"], f"{name}.second")
        do("Add", [do("Add", ["middle", f"{name}.first"], f"{name}.path.part"), f"{name}.second"], f"{name}.path")
        do("Mul", [do("Add", [f"{name}.path", "fading"], f"{name}.going.on"), "continued"], f"{name}.continued")
        do("Div", [do("Sub", [f"{name}.path", "base"], f"{name}.far"), "approach"], f"{name}.far.share")
        do("Mul", [do("Tanh", [f"{name}.far.share"], f"{name}.bounded"), "approach"], f"{name}.ahead")
        do("Mul", [do("Add", ["base", f"{name}.ahead"], f"{name}.from.here"), "fresh"], f"{name}.fresh")
        do("Div", [do("Add", [f"{name}.continued", f"{name}.fresh"], f"{name}.rad"), "scale"], f"{name}.plan")
        do("Div", [do("Sub", ["x", do("Mul", ["time", f"{name}.plan"], f"{name}.at.t")], f"{name}.off"), "left"], f"{name}.apart")
        do("Mul", [f"{name}.apart", "free"], f"{name}.apart.free")
        do("Mul", [f"{name}.apart.free", f"{name}.apart.free"], f"{name}.squares")
        between(do("Add", ["start", number(f"{name}.along.whole", side * arm.rate * arm.times[:, None])], f"{name}.along.to"), f"{name}.along.end")
        do("Sub", ["x.along", do("Sub", [f"{name}.along.end", "start"], f"{name}.along")], f"{name}.strayed")
        do("Mul", [do("Div", [f"{name}.strayed", "spread"], f"{name}.strayed.share"), "kept"], f"{name}.strayed.kept")
        do("Mul", [f"{name}.strayed.kept", f"{name}.strayed.kept"], f"{name}.strayed.squares")
        times(shaped(f"{name}.squares", 1, steps * joints, f"{name}.squares.row"), number("all", np.ones((steps * joints, 1))), f"{name}.free.sum")
        times(shaped(f"{name}.strayed.squares", 1, steps, f"{name}.strayed.row"), number("all.steps", np.ones((steps, 1))), f"{name}.kept.sum")
        do("Mul", [do("Add", [f"{name}.free.sum", f"{name}.kept.sum"], f"{name}.sum"), "half"], f"{name}.logit")
    do("Sigmoid", [do("Sub", ["b.logit", "a.logit"], "favour")], "right")
    do("Mul", [do("Sub", ["b.plan", "a.plan"], "across"), "right"], "chosen")
    do("Div", [do("Sub", [do("Add", ["a.plan", "chosen"], "chunk"), "x"], "to.go"), "left"], "v")
    shaped("v", 1, steps * joints, "velocity")
    inputs = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, size])
              for name, size in (("obs", len(see)), ("x_t", steps * joints), ("t", steps))]
    outputs = [helper.make_tensor_value_info("velocity", TensorProto.FLOAT, [1, steps * joints])]
    numbers = list({one.name: one for one in graph.numbers}.values())
    model = helper.make_model(helper.make_graph(graph.nodes, "arm_flow", inputs, outputs, numbers), producer_name="takt make_arm_flow",
                              opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 7
    onnx.checker.check_model(model)
    return model.SerializeToString()


class World:
    """A batch of arms that trail their setpoints, and what a policy that is asked now and then sees of them and their targets."""

    def __init__(self, arm, rng, arms):
        self.arm, self.rng, self.robot = arm, rng, arm.robot
        self.targets, self.now = nominal_targets(arm.robot, rng, arms), 0.0
        self.q = np.tile(arm.robot.home, (arms, 1))
        self.reference = self.q.copy()
        self.seen = None

    def observe(self):
        camera = self.robot.camera
        sensed = self.now - camera["delay"] - self.rng.uniform(0, camera["period"], len(self.q))
        sample = self.targets.at(sensed)
        self.seen = [sample] * self.arm.history if self.seen is None else self.seen[1:] + [sample]
        return np.concatenate([self.q - self.robot.home] + self.seen, axis=1)

    def rest(self):
        return np.repeat((self.q - self.robot.home)[:, None] / self.arm.scale, self.arm.steps, axis=1)

    def advance(self, plan):
        """Plays a step of the plan (outputs), and returns what is left of it."""
        h = self.arm.dt / 4
        for part in range(4):
            wanted = self.robot.home + self.arm.scale * (plan[:, 0] + (part + 1) / 4 * (plan[:, 1] - plan[:, 0]))
            self.reference += np.clip(wanted - self.reference, -self.robot.velocity * h, self.robot.velocity * h)
            self.q = self.q + (self.reference - self.q) * (1 - np.exp(-h / JOINT_LAG))
        self.now += self.arm.dt
        return np.concatenate([plan[:, 1:], plan[:, -1:]], axis=1)

    def error(self):
        return np.linalg.norm(arm_model.tool_position(self.robot, self.q) - self.targets.at(self.now), axis=1)


def closed_loop(arm, plans, seed, every, delay, prefixed, duration=6.0):
    """Arms that are asked each `every` steps and play the answer `delay` steps later: plans of every ask, and errors by step."""
    rng = np.random.default_rng(seed)
    world, answers, errors, fresh = World(arm, rng, 32), [], [], None
    plan, due = world.rest(), -1
    for instant in range(int(round(duration / arm.dt))):
        if instant % every == 0:
            # What is promised, and a step more; the first answer has nothing to continue.
            length = delay + 1 if prefixed and instant > 0 else 0
            observation = world.observe()
            fresh, due = plans.sample(observation, rng, plan, length), instant + delay
            answers.append((observation, plan, length, fresh))
        if instant == due:
            plan = np.concatenate([fresh[:, delay:], np.repeat(fresh[:, -1:], delay, axis=1)], axis=1)
        plan = world.advance(plan)
        errors.append(world.error())
    return answers, np.stack(errors)


def evaluate(arm, plans, seed):
    rng = np.random.default_rng(seed + 3000)
    steps = [int(round(s / arm.dt)) for s in (0.02, 0.1, 0.2)]
    period = max(1, int(round(arm.robot.policy["period"] / arm.dt)))
    loop, ways = {}, {}
    for delay in steps:
        for prefixed in (False, True):
            answers, errors = closed_loop(arm, plans, seed + 2000, max(period, delay + 1), delay, prefixed)
            settled = errors[len(errors) // 2:]
            name = f"{delay * arm.dt * 1e3:.0f} ms" + (", prefix" if prefixed else "")
            loop[name] = {"rms_m": float(np.sqrt((settled**2).mean())), "p95_m": float(np.quantile(settled, 0.95))}
    # Does it know both ways, and keep to the one that its prefix shows? Plans that leave the middle, and what follows them.
    answers, _ = closed_loop(arm, plans, seed + 2000, period, 0, False, 1.0)
    observation, _, _, begun = answers[-1]
    both, _ = plans.plans(observation, begun, 0)
    side = ((both - begun) ** 2).mean(axis=(2, 3)).argmin(axis=0)
    for length in (0, int(round(0.05 / arm.dt)), int(round(0.2 / arm.dt))):
        made = plans.sample(observation, rng, begun, length)
        both, _ = plans.plans(observation, begun, length)
        apart, between = (np.sqrt((off[..., length:, :] ** 2).mean(axis=(-2, -1))) for off in (made - both, both[0] - both[1]))
        ways[f"prefix {length * arm.dt * 1e3:.0f} ms"] = {
            "second_way": float((apart.argmin(axis=0) == 1).mean()), "kept_way": float((apart.argmin(axis=0) == side).mean()),
            "from_the_nearer": float(np.median(apart.min(axis=0))),
            "between_the_ways": float(np.median(between))}
    position = nominal_targets(arm.robot, rng, 256).at(0)
    missed = [float(np.quantile(np.linalg.norm(arm_model.tool_position(arm.robot, q + arm.robot.home) - position, axis=1), 0.95))
              for q in postures(arm, position)]
    return {"demonstrator_p95_m": dict(zip(("middle", "first", "second"), missed)), "ways": ways, "closed_loop": loop}


def examples(arm, plans, seed):
    rng = np.random.default_rng(seed + 4000)
    answers, _ = closed_loop(arm, plans, seed + 5000, 10, 0, False, 2.0)
    shown, outputs = [], []
    for row, (time, length) in enumerate(((0.0, 0), (0.25, 0), (0.5, 0), (0.0, 3), (0.25, 8), (0.5, arm.longest))):
        observation = answers[3 + row][0][:1].astype(np.float32).astype(np.float64)
        x = answers[3 + row][3][:1] + (1 - time) * rng.normal(0, 1, (1, arm.steps, arm.joints))
        x[:, :length] = answers[3 + row][3][:1, :length]
        x = x.astype(np.float32).astype(np.float64)
        times = np.full(arm.steps, time)
        times[:length] = 1.0
        shown.append(np.concatenate([observation[0], x.ravel(), times]).tolist())
        outputs.append(plans.velocity(observation, x, times).ravel().tolist())
    return {"inputs": shown, "outputs": outputs}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", type=Path, required=True, help="robot file")
    parser.add_argument("--lane", required=True, help="the joint that tells the two postures apart")
    parser.add_argument("--reach", type=float, required=True, help="rad by which it does, from the middle")
    parser.add_argument("--rate", type=float, default=2.5, help="of that, per second, on the way to a posture")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--samples", type=int, default=6000, help="demonstrations")
    parser.add_argument("--steps", type=int, default=12000, help="gradient steps")
    parser.add_argument("--output", type=Path, help="ONNX file to write (default: the one named by the robot file)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    arm = Arm(arguments.robot, arguments.lane, arguments.reach, arguments.rate)
    layers, rms = train(arm, arguments.seed, arguments.samples, arguments.steps)
    plans = Plans(arm, layers)
    model_bytes = onnx_bytes(arm, layers)
    output = arguments.output or arguments.robot.parent / arm.robot.policy["file"]
    output.write_bytes(model_bytes)
    lines = facts(arm.robot) + [f"flow {arm.scale:.9g} {arguments.lane} {arm.reach:.9g} {arm.rate:.9g}"]
    report = {
        "schema": "takt.training/1",
        "command": f"nice -n 19 /usr/bin/python3 policy_host/training/make_arm_flow.py --robot {arguments.robot} --lane {arguments.lane}"
                   f" --reach {arguments.reach:g} --rate {arguments.rate:g} --seed {arguments.seed} --samples {arguments.samples} --steps {arguments.steps}",
        "seed": arguments.seed,
        "versions": {"python": platform.python_version(), "torch": torch.__version__, "numpy": np.__version__, "onnx": onnx.__version__,
                     "machine": platform.machine()},
        "onnx_sha256": hashlib.sha256(model_bytes).hexdigest(),
        "configuration": lines,
        "configuration_sha256": hashlib.sha256("\n".join(lines).encode()).hexdigest(),
        "data": {"samples": arguments.samples},
        "residual_rms_rad": rms,
        "evaluation": evaluate(arm, plans, arguments.seed),
        "examples": examples(arm, plans, arguments.seed),
    }
    output.with_suffix(".training.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report["evaluation"], indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
