#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the demo arm's target-tracking policy by imitating a teacher that knows the target's future.

Data is aggregated over rounds: first the teacher drives, then the network drives half of the arms while the teacher
says what it should have done, so that the network learns from the states it brings about itself.
Reproducible: one thread, one seed, no time in the output file. Writes the ONNX file and a report beside the robot file.

    nice -n 19 /usr/bin/python3 policy_host/training/train_reach.py --robot config/arm6.yaml

The committed reports hold the command of each network.
"""
import argparse
import hashlib
import json
import platform
import sys
from pathlib import Path

import numpy as np
import torch

import arm_model
import network
from rollout import Conditions, roll_out
from target import nominal_targets, random_targets

BATCH = 256
EPISODE = 6.0  # s
SETTLE = 2.0  # s at the start of an evaluation episode that do not count


def sensor_columns(robot):
    column, found = 0, []
    for term, _, _, history in robot.policy["terms"]:
        width = 3 if term == "sensor" else robot.joints
        if term == "sensor":
            found += [(column + i * width, width) for i in range(history)]
        column += width * history
    return found


def acting(layers, robot):
    steps = robot.policy["steps"]
    return lambda inputs: network.evaluate(layers, inputs).reshape(len(inputs), steps, robot.joints)


def collect(robot, rng, arms, layers, interruption):
    """One round of episodes: (samples, values), (samples, steps * joints). Without layers the teacher drives alone."""
    driven = np.arange(arms) % 2 == 0

    def actor(inputs, lesson):
        chunk = lesson.copy()
        if layers is not None:
            chunk[driven] = acting(layers, robot)(inputs[driven])
        return chunk

    rough = Conditions(push=0.08, last_action_noise=0.05, wide_start=True, lag=(0.01, 0.05),
                       interruption=interruption)
    inputs, lessons, _ = roll_out(robot, random_targets(robot, rng, arms), rng, EPISODE, rough, actor)
    return inputs.reshape(-1, inputs.shape[-1]), lessons.reshape(len(lessons) * arms, -1)


def fit(model, optimiser, schedule, features, wanted, steps, rng):
    """`steps` gradient steps of Adam on the mean squared error; returns their mean loss."""
    total = 0.0
    for _ in range(steps):
        picks = rng.integers(0, len(features), BATCH)
        loss = torch.nn.functional.mse_loss(model(features[picks]), wanted[picks])
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        total += loss.item()
    return total / steps


def train(robot, seed, rounds, steps, arms, interruption):
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    model = network.build(sum(term_widths(robot)), robot.policy["steps"] * robot.joints)
    optimiser = torch.optim.Adam(model.parameters(), lr=2e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    inputs = wanted = normaliser = layers = None
    curve = []
    for round_ in range(rounds):
        more_inputs, more_wanted = collect(robot, rng, arms, layers, interruption)
        inputs = more_inputs if inputs is None else np.concatenate([inputs, more_inputs])
        wanted = more_wanted if wanted is None else np.concatenate([wanted, more_wanted])
        if normaliser is None:
            normaliser = network.Normaliser(inputs, wanted, sensor_columns(robot))
        features = torch.from_numpy(normaliser.features(inputs))
        targets = torch.from_numpy(normaliser.outputs(wanted))
        loss = fit(model, optimiser, schedule, features, targets, steps // rounds, rng)
        layers = network.folded_layers(model, normaliser)
        curve.append({"round": round_, "samples": len(inputs), "rms_rad": float(np.sqrt(loss)) * normaliser.spread})
        print(curve[-1], flush=True)
    return layers, curve


def term_widths(robot):
    return [(3 if term == "sensor" else robot.joints) * history for term, _, _, history in robot.policy["terms"]]


def tool_error(robot, make_targets, actor, seed, arms=64, duration=10.0):
    """Median and 95th percentile of the tool-to-target distance over held-out episodes, m."""
    rng = np.random.default_rng(seed)
    _, _, errors = roll_out(robot, make_targets(robot, rng, arms), rng, duration, Conditions(), actor)
    settled = errors[int(SETTLE / robot.policy["period"]):]
    return {"median_m": float(np.median(settled)), "p95_m": float(np.quantile(settled, 0.95)),
            "max_m": float(settled.max())}


def evaluate(robot, layers, seed):
    steps = robot.policy["steps"]
    actors = {"policy": lambda inputs, lesson: acting(layers, robot)(inputs), "teacher": lambda inputs, lesson: lesson,
              "hold_home": lambda inputs, lesson: np.zeros((len(inputs), steps, robot.joints))}
    return {kind: {name: tool_error(robot, make, actor, seed + 1000) for name, actor in actors.items()}
            for kind, make in (("robot_file_target", nominal_targets), ("random_targets", random_targets))}


def facts(robot):
    """Everything in the robot file that the result depends on, one canonical line each; the C++ test writes the same."""
    def line(name, values):
        return " ".join([name] + [value if isinstance(value, str) else f"{value:.9g}" for value in values])
    lines = [line("joint", [name, robot.home[i], robot.q_min[i], robot.q_max[i], robot.velocity[i]])
             for i, name in enumerate(robot.names)]
    lines += [line("link", [robot.names[i], str(link.parent), *link.origin, *link.rpy, *link.axis])
              for i, link in enumerate(robot.links)]
    lines.append(line("tool", [str(robot.tool_link), *robot.tool]))
    lines.append(line("policy", [robot.policy["period"], robot.policy["step_period"], str(robot.policy["steps"]),
                                 robot.policy["input"], robot.policy["output"]]))
    lines += [line("term", [term, sensor or "-", scale, str(history)])
              for term, sensor, scale, history in robot.policy["terms"]]
    lines.append(line("camera", [robot.camera[key] for key in ("period", "delay", "jitter")]))
    lines += [line(key, robot.target[key]) for key in ("centre", "amplitude", "frequency")]
    return lines


def fixed_inputs(robot, seed):
    """Observations from a clean episode, a few instants apart: what the test feeds to the C++ engine."""
    rng = np.random.default_rng(seed + 2000)
    inputs, _, _ = roll_out(robot, nominal_targets(robot, rng, 2), rng, 2.0, Conditions(), lambda _, lesson: lesson)
    return inputs[len(inputs) // 10::max(1, len(inputs) // 4 - 1)].reshape(-1, inputs.shape[-1])


def report(robot, arguments, model_bytes, layers, curve):
    lines = facts(robot)
    examples = fixed_inputs(robot, arguments.seed)
    return {
        "schema": "takt.training/1",
        "command": f"nice -n 19 /usr/bin/python3 policy_host/training/train_reach.py --robot {arguments.robot}"
                   f" --seed {arguments.seed} --steps {arguments.steps} --rounds {arguments.rounds} --arms {arguments.arms}"
                   + (f" --interruption {arguments.interruption}" if arguments.interruption else ""),
        "seed": arguments.seed,
        "versions": {"python": platform.python_version(), "torch": torch.__version__, "numpy": np.__version__,
                     "onnx": network.onnx.__version__, "machine": platform.machine()},
        "onnx_sha256": hashlib.sha256(model_bytes).hexdigest(),
        "configuration": lines,
        "configuration_sha256": hashlib.sha256("\n".join(lines).encode()).hexdigest(),
        "data": {"samples": curve[-1]["samples"], "episodes": arguments.arms * arguments.rounds, "episode_s": EPISODE},
        "loss_curve": curve,
        "evaluation": evaluate(robot, layers, arguments.seed),
        "examples": {"inputs": examples.tolist(), "outputs": network.evaluate(layers, examples).tolist()},
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", type=Path, required=True, help="robot file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=12000, help="gradient steps in all")
    parser.add_argument("--rounds", type=int, default=6, help="rounds of data aggregation")
    parser.add_argument("--arms", type=int, default=256, help="episodes per round")
    parser.add_argument("--interruption", type=float, default=0.0,
                        help="chance per observation that the host was restarted or absent before it")
    parser.add_argument("--output", type=Path, help="ONNX file to write (default: the one named by the robot file)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    robot = arm_model.load(arguments.robot)
    if robot.policy["scale"] != 1:
        parser.error(f"{arguments.robot}: expects actions of scale 1")
    layers, curve = train(robot, arguments.seed, arguments.rounds, arguments.steps, arguments.arms, arguments.interruption)
    model_bytes = network.onnx_bytes(layers, robot.policy["input"], robot.policy["output"])
    output = arguments.output or arguments.robot.parent / robot.policy["file"]
    output.write_bytes(model_bytes)
    result = report(robot, arguments, model_bytes, layers, curve)
    output.with_suffix(".training.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(result["evaluation"], indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
