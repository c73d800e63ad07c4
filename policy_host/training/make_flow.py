#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fits a policy that denoises its chunks (docs/flow-policies.md) to demonstrations of a balancing cart that has two places to stand: left
or right of where it is wanted, one as good as the other.

The demonstrator is the regulator of make_cart_pole.py. Which place it heads for it decides anew with every plan that is free from its
first step; one that must begin with steps of the plan before, which are being played already, keeps to its place and goes on from there.

What is fitted, by least squares, are its plans: one linear map of distance to the place (bounded), speed and pole for every length of a
prefix. The velocity of the flow that turns noise into one of two plans is then known, and the ONNX file computes it: plan m has the weight
exp(-|x - t plan_m|^2 / 2 (1 - t)^2), so far as x is free; of a prefix, whose time is 1, the exponent is its distance from what the
demonstrator would do for place m if nothing had to be kept.

Reproducible: one seed, no time in the output file. Writes the ONNX file and a report beside the robot file.

    nice -n 19 /usr/bin/python3 policy_host/training/make_flow.py --robot config/cart_pole_flow.yaml
"""
import argparse
import hashlib
import json
import platform
import sys
from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

import cart_pole_model
from make_cart_pole import Teacher, observation

SIDE, FAR = 0.15, 0.06  # m: of either place from the target; of a place that is gone to, at most
LONGEST = 13  # steps of a prefix
DT, SUBSTEPS, EPISODE = 0.001, 4, 8.0
RENEWALS = (1.0, 0.25, 0.12)  # chance per step that a plan is made anew
UPRIGHT, SWING, FARTHEST = 0.15, 1.0, 2.5  # rad, rad/s; rad that a plan goes: none of poles that are nearly lost
RIDGE = 1e-4  # of the least squares
NEAREST = 0.05  # of 1 - t: for up to 20 steps of denoising
PREFIX_SPREAD = 0.5  # units of output: how far a prefix lies from a plan made now, for the place that it goes to


class World:
    """A batch of carts with poles, and what the demonstrator would do with them."""

    def __init__(self, machine, rng, carts, rough):
        self.machine, self.rng, self.rough = machine, rng, rough
        self.steps, self.step = machine.policy["steps"], machine.policy["step_period"]
        self.teacher = Teacher(machine)
        self.state = np.zeros((carts, 4))
        self.state[:, 1] = rng.normal(0, 0.02, carts)
        if rough:
            self.state += rng.normal(0, 1, self.state.shape) * np.array([2.0, 0.04, 1.0, 0.15])
        self.seen_speed = self.state[:, 2:].copy()
        self.target = rng.uniform(-machine.reach, machine.reach, carts)
        self.next_step = rng.uniform(0, 3.0, carts)
        self.now, self.fell = 0.0, np.zeros(carts, dtype=bool)

    def rest(self):
        return np.repeat(self.state[:, :1], self.steps, axis=1)

    def observe(self):
        return observation(self.machine, np.concatenate([self.state[:, :2], self.seen_speed], axis=1), self.target)

    def plan(self, side, before, known):
        """(carts, steps), rad: the first `known` (carts) steps of `before`, then on to the place on this side (carts), -1 or 1."""
        machine, gains, length = self.machine, self.teacher._gains, self.teacher._length
        goal = self.target + SIDE * side
        place, speed = self.state[:, 0] * machine.radius, self.seen_speed[:, 0] * machine.radius
        pole, pole_speed = self.state[:, 1], self.seen_speed[:, 1]
        before = before * machine.radius
        far = np.clip(goal - place, -FAR, FAR)  # from where it is: the path's own distance is bounded by it
        goal = place + far
        place = np.where(known > 0, before[:, 0], place)
        h, path = self.step / SUBSTEPS, [place]
        for step in range(self.steps - 1):
            kept = step + 1 < known
            along = (before[:, step + 1] - before[:, step]) / self.step
            for _ in range(SUBSTEPS):
                wanted = -(gains[0] * (place - goal) + gains[1] * speed + gains[2] * pole + gains[3] * pole_speed)
                wanted = np.where(kept, (along - speed) / h, wanted)
                pole_speed = pole_speed + h * (cart_pole_model.GRAVITY * np.sin(pole) - wanted * np.cos(pole)) / length
                speed, place, pole = speed + h * wanted, place + h * (speed + h * wanted), pole + h * pole_speed
            place = np.where(kept, before[:, step + 1], place)
            path.append(place)
        return np.stack(path, axis=1) / machine.radius

    def advance(self, plan):
        """Plays a step of the plan, and returns what is left of it."""
        machine = self.machine
        if self.rough and self.rng.uniform() < 0.05:
            self.state[:, 2:] += self.rng.normal(0, 1, (len(self.state), 2)) * np.array([0.3, 0.2])
        due = self.now >= self.next_step
        self.target = np.where(due, self.rng.uniform(-machine.reach, machine.reach, len(due)), self.target)
        self.next_step = np.where(due, self.now + 3.0, self.next_step)
        speed = (plan[:, 1] - plan[:, 0]) / self.step
        for tick in range(int(round(self.step / DT))):
            wanted = plan[:, 0] + speed * tick * DT
            torque = machine.kp * (wanted - self.state[:, 0]) + machine.kd * (speed - self.state[:, 2])
            state = machine.step(self.state, np.clip(torque, -machine.torque, machine.torque), DT)
            self.state = np.where(self.fell[:, None], self.state, state)
            self.seen_speed = self.seen_speed + (self.state[:, 2:] - self.seen_speed) * DT * machine.observer / 2
            self.fell |= np.abs(self.state[:, 1]) > 0.5
        self.now += self.step
        return np.concatenate([plan[:, 1:], plan[:, -1:]], axis=1)

    def error(self):
        """m, from the nearer place."""
        off = self.state[:, 0] * self.machine.radius - self.target
        return np.minimum(np.abs(off - SIDE), np.abs(off + SIDE))


def collect(machine, rng, carts):
    """Observations, plans in units of output, which side, and how long the prefix was."""
    world = World(machine, rng, carts, rough=True)
    plan, side = world.rest(), rng.choice([-1, 1], carts)
    renewal = np.array(RENEWALS)[rng.integers(0, len(RENEWALS), carts)]
    parts = []
    for _ in range(int(round(EPISODE / world.step))):
        renew = rng.uniform(size=carts) < renewal
        known = np.where(rng.uniform(size=carts) < 0.2, 0, rng.integers(0, LONGEST + 1, carts))
        side = np.where(renew & (known == 0), rng.choice([-1, 1], carts), side)
        fresh = world.plan(side, plan, known)
        keep = renew & (np.abs(world.state[:, 1]) < UPRIGHT) & (np.abs(world.state[:, 3]) < SWING)
        keep &= np.abs(fresh - world.state[:, :1]).max(axis=1) < FARTHEST
        parts.append((world.observe()[keep], fresh[keep] / machine.policy["scale"], side[keep], known[keep]))
        plan = world.advance(np.where(renew[:, None], fresh, plan))
    return [np.concatenate(part) for part in zip(*parts)]


class Plans:
    """Both plans of an observation, and of a prefix: the linear maps, and what the ONNX file makes of them (float64)."""

    def __init__(self, machine, data):
        self.machine, self.steps = machine, machine.policy["steps"]
        inputs, chunks, side, known = data
        self.maps, self.residuals = [], []
        for length in range(LONGEST + 1):
            here = known == length
            features = self.features(inputs[here], side[here], chunks[here], length)
            rest = chunks[here] - self.skip(inputs[here])
            gram = features.T @ features + RIDGE * np.eye(features.shape[1])
            weights = np.linalg.solve(gram, features.T @ rest).astype(np.float32).astype(np.float64)
            self.maps.append(weights)
            self.residuals.append(float(np.sqrt(np.mean((features @ weights - rest) ** 2))))

    def skip(self, inputs):
        return inputs[:, :1] / (self.machine.policy["scales"][0] * self.machine.policy["scale"])

    def features(self, inputs, side, chunks, length):
        """Distance to the place (bounded), pole, speeds; and the prefix from where the cart is."""
        position, velocity, sensor = self.machine.policy["scales"]
        far = np.clip(inputs[:, 4] / sensor + SIDE * side - inputs[:, 0] / position * self.machine.radius, -FAR, FAR)
        prefix = (chunks - self.skip(inputs))[:, :length]
        return np.concatenate([far[:, None], inputs[:, 1:4], prefix], axis=1)

    def plan(self, inputs, side, x, length):
        sides = np.full(len(inputs), side)
        made = self.skip(inputs) + self.features(inputs, sides, x, length) @ self.maps[length]
        return made

    def velocity(self, inputs, x, time):
        """What the ONNX file computes; every row has the same prefix."""
        length = int((time[0] >= 1).sum())
        left = np.maximum(1 - time, NEAREST)
        free = time < 1
        logits, plans = [], []
        for side in (-1, 1):
            plan, fresh = self.plan(inputs, side, x, length), self.plan(inputs, side, x, 0)
            apart = np.where(free, (x - time * plan) / left, (x - fresh) / PREFIX_SPREAD)
            logits.append(-0.5 * (apart ** 2).sum(axis=1))
            plans.append(plan)
        right = 1 / (1 + np.exp(np.clip(logits[0] - logits[1], -80, 80)))
        chunk = plans[0] + right[:, None] * (plans[1] - plans[0])
        return (chunk - x) / left

    def sample(self, inputs, rng, prefix, length, denoising=8):
        x = rng.normal(0, 1, (len(inputs), self.steps))
        for i in range(denoising):
            time = np.full(x.shape, i / denoising)
            time[:, :length], x[:, :length] = 1.0, prefix[:, :length]
            x = x + self.velocity(inputs, x, time) / denoising
        x[:, :length] = prefix[:, :length]
        return x


class Graph:
    """Nodes and numbers of an ONNX file."""

    def __init__(self):
        self.nodes, self.numbers = [], []

    def number(self, name, value):
        self.numbers.append(numpy_helper.from_array(np.asarray(value, dtype=np.float32), name))
        return name

    def shape(self, name, value):
        self.numbers.append(numpy_helper.from_array(np.asarray(value, dtype=np.int64), name))
        return name

    def do(self, kind, inputs, output, **attributes):
        self.nodes.append(helper.make_node(kind, inputs, [output], name=output, **attributes))
        return output


def onnx_bytes(plans):
    machine, steps = plans.machine, plans.steps
    position, _, sensor = machine.policy["scales"]
    graph = Graph()
    one, nothing, most = graph.number("one", np.ones((1, 1))), graph.number("nothing", np.zeros((1, 1))), graph.number("most", np.full((1, 1), 1e4))
    # Of each step, whether it is kept: its time is 1, that of the others at most 1 - 1 / (steps of denoising).
    sharp = graph.do("Mul", ["t", graph.number("steep", [[1e4]])], "t.steep")
    graph.do("Sub", [sharp, graph.number("threshold", [[1e4 - 1]])], "t.over")
    graph.do("Max", ["t.over", nothing], "kept")
    graph.do("Sub", [one, "kept"], "free")
    graph.do("Sub", [one, "t"], "left.exact")
    graph.do("Max", ["left.exact", graph.number("nearest", [[NEAREST]])], "left")
    # One of LONGEST + 1 maps: length d where step d - 1 is kept and step d is not.
    ends = np.zeros((steps, LONGEST + 1))
    for length in range(LONGEST + 1):
        if length > 0:
            ends[length - 1, length] += 1
        ends[length, length] -= 1
    first = np.zeros((1, LONGEST + 1))
    first[0, 0] = 1
    graph.do("Gemm", ["kept", graph.number("ends", ends), graph.number("first", first)], "length")
    graph.do("Gemm", ["obs", graph.number("skip.weight", np.repeat([[1 / (position * machine.policy["scale"])], [0], [0], [0], [0]], steps, axis=1)),
                      graph.number("skip.bias", np.zeros((1, steps)))], "skip")
    graph.do("Sub", ["x_t", "skip"], "x.rest")
    graph.do("Mul", ["x.rest", "kept"], "prefix")
    width = 4 + LONGEST  # of what one map takes
    take = np.zeros((steps, width))
    take[:LONGEST, 4:] = np.eye(LONGEST)
    graph.do("Gemm", ["prefix", graph.number("prefix.place", take), graph.number("no.width", np.zeros((1, width)))], "prefix.shown")
    all_maps = np.zeros((LONGEST + 1, width, steps))
    for length, weights in enumerate(plans.maps):
        all_maps[length, :4 + length] = weights
    graph.number("maps", all_maps.reshape(-1, steps))
    graph.number("fresh.map", all_maps[0])
    graph.number("no.steps", np.zeros((1, steps)))
    spread = np.eye(LONGEST + 1)
    graph.number("repeat.length", np.repeat(spread, width, axis=1))
    graph.number("repeat.shown", np.tile(np.eye(width), (1, LONGEST + 1)))
    graph.number("no.all", np.zeros((1, (LONGEST + 1) * width)))
    graph.do("Gemm", ["length", "repeat.length", "no.all"], "gate")
    see = np.zeros((5, width))
    see[1, 1] = see[2, 2] = see[3, 3] = 1
    graph.number("see", see)
    graph.number("no.see", np.zeros((1, width)))
    graph.do("Gemm", ["obs", "see", "no.see"], "seen")
    at_first = np.zeros((1, width))
    at_first[0, 0] = 1
    graph.number("at.first", at_first)
    for name, side in (("a", -1), ("b", 1)):
        graph.do("Gemm", ["obs", graph.number(f"{name}.far.weight", [[-machine.radius / position], [0], [0], [0], [1 / sensor]]),
                          graph.number(f"{name}.far.bias", [[side * SIDE]])], f"{name}.far.whole")
        graph.do("Min", [f"{name}.far.whole", graph.number(f"{name}.far.most", [[FAR]])], f"{name}.far.less")
        graph.do("Max", [f"{name}.far.less", graph.number(f"{name}.far.least", [[-FAR]])], f"{name}.far")
        graph.do("Gemm", [f"{name}.far", "at.first", "seen"], f"{name}.state")
        graph.do("Add", [f"{name}.state", "prefix.shown"], f"{name}.shown")
        graph.do("Gemm", [f"{name}.shown", "repeat.shown", "no.all"], f"{name}.everywhere")
        graph.do("Mul", [f"{name}.everywhere", "gate"], f"{name}.gated")
        graph.do("Gemm", [f"{name}.gated", "maps", "skip"], f"{name}.plan")
        graph.do("Gemm", [f"{name}.state", "fresh.map", "skip"], f"{name}.fresh")
        graph.do("Mul", ["t", f"{name}.plan"], f"{name}.at.t")
        graph.do("Sub", ["x_t", f"{name}.at.t"], f"{name}.off")
        graph.do("Div", [f"{name}.off", "left"], f"{name}.free.apart")
        graph.do("Mul", [f"{name}.free.apart", "free"], f"{name}.free.part")
        graph.do("Sub", ["x_t", f"{name}.fresh"], f"{name}.kept.off")
        graph.do("Mul", [f"{name}.kept.off", "kept"], f"{name}.kept.only")
        graph.do("Mul", [f"{name}.kept.only", graph.number(f"{name}.spread", [[1 / PREFIX_SPREAD]])], f"{name}.kept.part")
        graph.do("Add", [f"{name}.free.part", f"{name}.kept.part"], f"{name}.apart")
        graph.do("Mul", [f"{name}.apart", f"{name}.apart"], f"{name}.squares")
        graph.do("Gemm", [f"{name}.squares", graph.number(f"{name}.half", np.full((steps, 1), -0.5)), nothing], f"{name}.logit")
    graph.do("Sub", ["b.logit", "a.logit"], "favour")
    graph.do("Sigmoid", ["favour"], "right")
    graph.do("Sub", ["b.plan", "a.plan"], "across")
    graph.do("Mul", ["across", "right"], "chosen")
    graph.do("Add", ["a.plan", "chosen"], "chunk")
    graph.do("Sub", ["chunk", "x_t"], "way")
    graph.do("Div", ["way", "left"], "velocity")
    inputs = [helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, size]) for name, size in (("obs", 5), ("x_t", steps), ("t", steps))]
    numbers = [number for number in graph.numbers if any(number.name in node.input for node in graph.nodes)]
    model = helper.make_model(
        helper.make_graph(graph.nodes, "flow", inputs, [helper.make_tensor_value_info("velocity", TensorProto.FLOAT, [1, steps])], numbers),
        producer_name="takt make_flow", opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 7
    onnx.checker.check_model(model)
    return model.SerializeToString()


def ways(machine, plans, seed):
    """Does it know both ways, and keep to the one that its prefix shows? By the nearer of the demonstrator's two plans."""
    rng, carts = np.random.default_rng(seed + 1000), 256
    world = World(machine, rng, carts, rough=False)
    plan, side = world.rest(), rng.choice([-1, 1], carts)
    for _ in range(50):
        plan = world.advance(world.plan(side, plan, np.full(carts, 2)))
    world.target = world.state[:, 0] * machine.radius - 0.5 * SIDE * side  # both places ahead, one of them being gone to
    plan = world.advance(world.plan(side, plan, np.zeros(carts)))
    result = {}
    for length in (0, 5, 10):
        made = plans.sample(world.observe(), rng, plan / machine.policy["scale"], length)
        both = np.stack([world.plan(np.full(carts, each), plan, np.full(carts, length)) / machine.policy["scale"] for each in (-1, 1)])
        apart = np.sqrt(((made[None] - both) ** 2).mean(axis=2))
        result[f"prefix {length}"] = {"second_way": float((apart.argmin(axis=0) == 1).mean()),
                                      "kept_way": float((2 * apart.argmin(axis=0) - 1 == side).mean()),
                                      "from_the_nearer": float(np.median(apart.min(axis=0))),
                                      "between_the_ways": float(np.median(np.sqrt(((both[0] - both[1]) ** 2).mean(axis=1))))}
    return result


def closed_loop(machine, plans, seed):
    """Carts that answer after `delay` steps and are asked again a step later, with and without a prefix: who fell, and the others' errors."""
    result, carts = {}, 64
    for name, delay, prefixed in (("delay 0", 0, False), ("delay 5", 5, False), ("delay 5, prefix", 5, True), ("delay 10", 10, False),
                                  ("delay 10, prefix", 10, True)):
        rng = np.random.default_rng(seed + 2000)
        world = World(machine, rng, carts, rough=False)
        plan, errors, due, fresh = world.rest(), [], -1, None
        for instant in range(int(round(6.0 / world.step))):
            if instant % (delay + 1) == 0:
                length = delay if prefixed else 0
                fresh = plans.sample(world.observe(), rng, plan / machine.policy["scale"], length) * machine.policy["scale"]
                due = instant + delay
            if instant == due:
                plan = np.concatenate([fresh[:, delay:], np.repeat(fresh[:, -1:], delay, axis=1)], axis=1)
            plan = world.advance(plan)
            errors.append(world.error())
        settled = np.stack(errors[100:])[:, ~world.fell]
        result[name] = {"fell": float(world.fell.mean()), "median_m": float(np.median(settled)) if settled.size else None}
    return result


def examples(machine, plans, seed):
    rng = np.random.default_rng(seed + 3000)
    world = World(machine, rng, 6, rough=True)
    inputs = world.observe().astype(np.float32).astype(np.float64)
    x = (plans.skip(inputs) + 0.3 * rng.normal(0, 1, (6, plans.steps))).astype(np.float32).astype(np.float64)
    shown, outputs = [], []
    for row, (time, length) in enumerate(((0.0, 0), (0.25, 0), (0.5, 0), (0.0, 5), (0.25, 8), (0.5, 12))):
        times = np.full((1, plans.steps), time)
        times[:, :length] = 1.0
        shown.append(np.concatenate([inputs[row], x[row], times[0]]).tolist())
        outputs.append(plans.velocity(inputs[row:row + 1], x[row:row + 1], times)[0].tolist())
    return {"inputs": shown, "outputs": outputs}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", type=Path, required=True, help="robot file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--carts", type=int, default=128, help="demonstrations")
    parser.add_argument("--output", type=Path, help="ONNX file to write (default: the one named by the robot file)")
    arguments = parser.parse_args()
    machine = cart_pole_model.load(arguments.robot)
    rng = np.random.default_rng(arguments.seed)
    data = collect(machine, rng, arguments.carts)
    plans = Plans(machine, data)
    print(len(data[0]), "plans; residuals", [round(one, 4) for one in plans.residuals], flush=True)
    model_bytes = onnx_bytes(plans)
    output = arguments.output or arguments.robot.parent / machine.policy["file"]
    output.write_bytes(model_bytes)
    facts = machine.facts + [cart_pole_model.line("flow", [machine.policy["scale"], SIDE])]
    report = {
        "schema": "takt.training/1",
        "command": f"nice -n 19 /usr/bin/python3 policy_host/training/make_flow.py --robot config/cart_pole_flow.yaml --seed {arguments.seed}"
                   f" --carts {arguments.carts}",
        "seed": arguments.seed,
        "versions": {"python": platform.python_version(), "numpy": np.__version__, "onnx": onnx.__version__, "machine": platform.machine()},
        "onnx_sha256": hashlib.sha256(model_bytes).hexdigest(),
        "configuration": facts,
        "configuration_sha256": hashlib.sha256("\n".join(facts).encode()).hexdigest(),
        "data": {"samples": len(data[0]), "episodes": arguments.carts, "episode_s": EPISODE},
        "residual_rms": plans.residuals,
        "evaluation": {"ways": ways(machine, plans, arguments.seed), "closed_loop": closed_loop(machine, plans, arguments.seed)},
        "examples": examples(machine, plans, arguments.seed),
    }
    output.with_suffix(".training.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report["evaluation"], indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
