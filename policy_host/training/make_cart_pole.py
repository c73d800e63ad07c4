#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the balancing demo's policy by imitating a teacher that knows the mechanics.

The teacher is a linear-quadratic regulator of the cart's acceleration with bounded acceleration, speed and distance; a
chunk is where it would take the cart. The network gives the same path, relative to where the cart is. Data is
aggregated over rounds: first the teacher drives, then the network drives half of the carts while the teacher says what
it should have done.
Reproducible: one thread, one seed, no time in the output file. Writes the ONNX file and a report beside the robot file,
and prints the gains for the robot file's fallback.

    nice -n 19 /usr/bin/python3 policy_host/training/make_cart_pole.py --robot config/cart_pole.yaml
"""
import argparse
import hashlib
import json
import platform
import sys
from pathlib import Path

import numpy as np
import torch

import cart_pole_model
import network

HIDDEN, BATCH = 64, 256
EPISODE, DT = 6.0, 0.001  # s
FELL = 0.6  # rad
LATENCY = (0.006, 0.016)  # s from an observation to the path it brings
ACCELERATION, SPEED, FAR = 8.0, 0.9, 0.15  # m/s^2, m/s, m: the teacher's bounds
SUBSTEPS = 8  # of one step of a chunk


class Teacher:
    def __init__(self, machine):
        self._machine = machine
        length = machine.pole_inertia * machine.radius / machine.coupling  # m, of the equivalent point pendulum
        a = np.array([[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, cart_pole_model.GRAVITY / length, 0]], dtype=float)
        b = np.array([[0.0], [1.0], [0.0], [-1.0 / length]])
        self._length = length
        self._gains = cart_pole_model.regulator(a, b, [20.0, 0.5, 5.0, 0.5], 0.02)

    def path(self, state, target):
        """Where the cart goes, relative to where it is: (batch, steps), rad."""
        machine, gains = self._machine, self._gains
        place, speed = state[:, 0] * machine.radius, state[:, 2] * machine.radius
        pole, pole_speed, start = state[:, 1], state[:, 3], place
        h, path = machine.policy["step_period"] / SUBSTEPS, [np.zeros(len(state))]
        for _ in range(machine.policy["steps"] - 1):
            for _ in range(SUBSTEPS):
                far = np.clip(place - target, -FAR, FAR)
                wanted = -(gains[0] * far + gains[1] * speed + gains[2] * pole + gains[3] * pole_speed)
                wanted = np.clip(np.clip(wanted, -ACCELERATION, ACCELERATION), (-SPEED - speed) / h, (SPEED - speed) / h)
                pole_speed = pole_speed + h * (cart_pole_model.GRAVITY * np.sin(pole) - wanted * np.cos(pole)) / self._length
                speed, place, pole = speed + h * wanted, place + h * (speed + h * wanted), pole + h * pole_speed
            path.append((place - start) / machine.radius)
        return np.stack(path, axis=1)


def observation(machine, state, target):
    position, velocity, sensor = machine.policy["scales"]
    return np.concatenate([position * state[:, :2], velocity * state[:, 2:], sensor * target[:, None]], axis=1)


def drive_torque(machine, state, start, path, since):
    """The drive's impedance on the path between its steps, as the executive plays it."""
    place = since / machine.policy["step_period"]
    step = np.minimum(place.astype(int), path.shape[1] - 2)
    rows = np.arange(len(state))
    rise = path[rows, step + 1] - path[rows, step]
    wanted = start + path[rows, step] + np.minimum(place - step, 1.0) * rise
    speed = rise / machine.policy["step_period"]
    torque = machine.kp * (wanted - state[:, 0]) + machine.kd * (speed - state[:, 2])
    return np.clip(torque, -machine.torque, machine.torque)


def roll_out(machine, rng, carts, actor, rough):
    """Runs `actor(observations, lessons) -> paths`: observations, lessons and errors, over time first; who fell."""
    teacher, steps = Teacher(machine), int(round(machine.policy["period"] / DT))
    state = np.zeros((carts, 4))
    state[:, 1] = rng.normal(0, 0.02, carts)
    if rough:
        state = state + rng.normal(0, 1, state.shape) * np.array([3.0, 0.05, 3.0, 0.3])
    seen_speed, target, fell = state[:, 2:].copy(), np.zeros(carts), np.zeros(carts, dtype=bool)
    waiting = playing = (np.full(carts, -1.0), state[:, 0].copy(), np.zeros((carts, machine.policy["steps"])))
    next_step = rng.uniform(0, 2.0, carts)
    inputs, lessons, errors = [], [], []
    for tick in range(int(round(EPISODE / DT))):
        now = tick * DT
        due = now >= next_step
        target = np.where(due, rng.uniform(-machine.reach, machine.reach, carts), target)
        next_step = np.where(due, now + 2.0, next_step)
        if tick % steps == 0:
            shown = np.concatenate([state[:, :2], seen_speed], axis=1)
            inputs.append(observation(machine, shown, target).astype(np.float32))
            lessons.append(teacher.path(shown, target).astype(np.float32))
            errors.append(np.where(fell, np.nan, np.abs(state[:, 0] * machine.radius - target)))
            waiting = (np.full(carts, now), state[:, 0].copy(), actor(inputs[-1], lessons[-1]))
            ready = now + rng.uniform(*LATENCY)
            if rough and tick % 500 == 0:
                state[:, 2:] += rng.normal(0, 1, (carts, 2)) * np.array([0.5, 0.3])
        if waiting is not None and now >= ready:
            playing, waiting = waiting, None
        torque = np.where(playing[0] < 0, 0.0, drive_torque(machine, state, playing[1], playing[2], now - playing[0]))
        state = np.where(fell[:, None], 0.0, machine.step(state, torque, DT))
        seen_speed = seen_speed + (state[:, 2:] - seen_speed) * DT * machine.observer / 2
        fell |= (np.abs(state[:, 1]) > FELL) | (np.abs(state[:, 0]) * machine.radius > 2 * machine.reach)
    return np.stack(inputs), np.stack(lessons), np.stack(errors), fell


def acting(layers):
    return lambda inputs, lessons: network.evaluate(layers, inputs)


class Scales:
    """Fixed affine maps around the network: one spread per input and per step of the path."""

    def __init__(self, inputs, paths):
        self.centre, self.width = inputs.mean(axis=0), inputs.std(axis=0) + 1e-6
        self.spread = np.maximum(paths.std(axis=0), 1e-3)

    def features(self, inputs):
        return torch.from_numpy(((inputs - self.centre) / self.width).astype(np.float32))

    def outputs(self, paths):
        return torch.from_numpy((paths / self.spread).astype(np.float32))

    def folded(self, model):
        layers = [(layer.weight.detach().numpy().astype(np.float64), layer.bias.detach().numpy().astype(np.float64))
                  for layer in model if isinstance(layer, torch.nn.Linear)]
        (first, first_bias), middle, (last, last_bias) = layers
        layers = [(first / self.width, first_bias - first @ (self.centre / self.width)), middle,
                  (self.spread[:, None] * last, self.spread * last_bias)]
        return [(weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in layers]


def train(machine, seed, rounds, steps, carts):
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    model = network.build(5, machine.policy["steps"], HIDDEN)
    optimiser = torch.optim.Adam(model.parameters(), lr=3e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    inputs = paths = scales = layers = None
    curve = []
    for round_ in range(rounds):
        driven = np.arange(carts) % 2 == 0

        def actor(seen, lessons, layers=layers, driven=driven):
            return lessons if layers is None else np.where(driven[:, None], network.evaluate(layers, seen), lessons)

        seen, taught, _, _ = roll_out(machine, rng, carts, actor, rough=True)
        seen, taught = seen.reshape(-1, 5), taught.reshape(-1, taught.shape[-1])
        inputs = seen if inputs is None else np.concatenate([inputs, seen])
        paths = taught if paths is None else np.concatenate([paths, taught])
        scales = scales or Scales(inputs, paths)
        features, wanted, total = scales.features(inputs), scales.outputs(paths), 0.0
        for _ in range(steps // rounds):
            picks = rng.integers(0, len(features), BATCH)
            loss = torch.nn.functional.mse_loss(model(features[picks]), wanted[picks])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
            schedule.step()
            total += loss.item()
        layers = scales.folded(model)
        curve.append({"round": round_, "samples": len(inputs), "relative_rms": float(np.sqrt(total / (steps // rounds)))})
        print(curve[-1], flush=True)
    return layers, curve


def evaluate(machine, layers, seed):
    actors = {"policy": acting(layers), "teacher": lambda inputs, lessons: lessons,
              "hold": lambda inputs, lessons: np.zeros_like(lessons)}
    result = {}
    for name, actor in actors.items():
        _, _, errors, fell = roll_out(machine, np.random.default_rng(seed + 1000), 64, actor, rough=False)
        result[name] = {"fell": float(fell.mean()), "median_m": float(np.nanmedian(errors)),
                        "rms_m": float(np.sqrt(np.nanmean(errors ** 2)))}
    return result


def report(machine, arguments, model_bytes, layers, skip, curve):
    _, rng = None, np.random.default_rng(arguments.seed + 2000)
    examples = roll_out(machine, rng, 2, lambda inputs, lessons: lessons, rough=False)[0][10::24].reshape(-1, 5)
    return {
        "schema": "takt.training/1",
        "command": "nice -n 19 /usr/bin/python3 policy_host/training/make_cart_pole.py --robot config/cart_pole.yaml"
                   f" --seed {arguments.seed} --steps {arguments.steps} --rounds {arguments.rounds} --carts {arguments.carts}",
        "seed": arguments.seed,
        "versions": {"python": platform.python_version(), "torch": torch.__version__, "numpy": np.__version__,
                     "onnx": network.onnx.__version__, "machine": platform.machine()},
        "onnx_sha256": hashlib.sha256(model_bytes).hexdigest(),
        "configuration": machine.facts,
        "configuration_sha256": hashlib.sha256("\n".join(machine.facts).encode()).hexdigest(),
        "data": {"samples": curve[-1]["samples"], "episodes": arguments.carts * arguments.rounds, "episode_s": EPISODE},
        "loss_curve": curve,
        "evaluation": evaluate(machine, layers, arguments.seed),
        "fallback_gains": [round(float(gain), 4) for gain in cart_pole_model.fallback_gains(machine)],
        "examples": {"inputs": examples.tolist(), "outputs": network.evaluate(layers, examples, skip).tolist()},
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", type=Path, required=True, help="robot file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=12000, help="gradient steps in all")
    parser.add_argument("--rounds", type=int, default=5, help="rounds of data aggregation")
    parser.add_argument("--carts", type=int, default=256, help="episodes per round")
    parser.add_argument("--output", type=Path, help="ONNX file to write (default: the one named by the robot file)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    machine = cart_pole_model.load(arguments.robot)
    layers, curve = train(machine, arguments.seed, arguments.rounds, arguments.steps, arguments.carts)
    # What the file gives are places, so the cart's own is added to the path.
    skip = np.zeros((machine.policy["steps"], 5))
    skip[:, 0] = 1.0 / machine.policy["scales"][0]
    model_bytes = network.onnx_bytes(layers, machine.policy["input"], machine.policy["output"], "make_cart_pole", skip)
    output = arguments.output or arguments.robot.parent / machine.policy["file"]
    output.write_bytes(model_bytes)
    result = report(machine, arguments, model_bytes, layers, skip, curve)
    output.with_suffix(".training.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    print(json.dumps({key: result[key] for key in ("evaluation", "fallback_gains")}, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
