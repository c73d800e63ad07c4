#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the policy of the robot on two wheels, which falls without a balancing policy, by gradients through the simulated mechanics.

A batch of robots, each with a latency, a body mass and a command of its own, is simulated; what it costs to be tilted, to be slower or
faster than told and to hurry the motors is differentiated by the network's weights. Rollouts grow from half a second to four.
Reproducible: one thread, one seed, no time in the output file. Writes the ONNX file and a report beside the robot file.

    nice -n 19 /usr/bin/python3 policy_host/training/make_balancer.py --robot config/balancer.yaml
"""
import argparse
import hashlib
import json
import platform
import sys
from pathlib import Path

import numpy as np
import torch

import balancer_model
import network

HIDDEN, BATCH, DT = 32, 128, 0.005
LATENCY = (2, 12)  # steps of DT from an observation to the wheels
SHORTEST, LONGEST = 0.5, 4.0  # s
FELL = 0.8  # rad
RATE = 3e-3
EXAMPLES = 24


def conditions(machine, generator, batch, rough):
    """Initial states, commands, factors on the mass, latencies."""
    def uniform(*shape):
        return 2 * torch.rand(*shape, generator=generator) - 1
    state = torch.randn(batch, 4, generator=generator) * torch.tensor([0.3, 0.08, 0.3, 0.3] if rough else [0.0, 0.02, 0.0, 0.0])
    minimum, maximum = (torch.tensor(machine.policy[name], dtype=torch.float32) for name in ("minimum", "maximum"))
    command = minimum + (maximum - minimum) * torch.rand(batch, 3, generator=generator)
    command[torch.rand(batch, generator=generator) < 0.3] = 0.0
    latency = torch.randint(LATENCY[0], LATENCY[1] + 1, (batch,), generator=generator)
    return state, command, 1 + 0.15 * uniform(batch), latency


def roll_out(machine, actor, generator, batch, seconds, rough=True, latency=None):
    """Costs (batch) and what was seen: observations and states, time first. `latency`: steps of DT, the same for all."""
    state, command, heavier, late = conditions(machine, generator, batch, rough)
    late = late if latency is None else torch.full((batch,), latency)
    every = int(round(machine.policy["period"] / DT))
    wanted = before = machine.wheel_speeds(state).detach()
    cost, waiting, seen, states = torch.zeros(batch), [], [], []
    for step in range(int(round(seconds / DT))):
        if step % every == 0:
            noise = torch.randn(batch, 11, generator=generator) * (0.003 if rough else 0.0)
            seen.append(machine.observation(state, command) + noise)
            states.append(state)
            action = machine.policy["scale"] * actor(seen[-1])
            cost = cost + 0.002 * ((action - before) ** 2).mean(1)
            before = action
            waiting.append((step + late, action))
        for due, action in waiting:
            wanted = torch.where((due == step)[:, None], action, wanted)
        waiting = [one for one in waiting if bool((one[0] > step).any())]
        state = machine.step(state, wanted, heavier, DT)
        speed, tilt, tilting, turning = state.unbind(1)
        cost = cost + (speed - command[:, 0]) ** 2 + tilt ** 2 + 0.05 * tilting ** 2 + 0.3 * (turning - command[:, 2]) ** 2
    return cost * DT / seconds, torch.stack(seen), torch.stack(states), command


def train(machine, seed, rounds):
    generator = torch.Generator().manual_seed(seed)
    torch.manual_seed(seed)
    model = network.build(11, 2, HIDDEN)
    with torch.no_grad():
        model[-1].weight *= 0.1
    optimiser = torch.optim.Adam(model.parameters(), lr=RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, rounds)
    curve = []
    for round_ in range(rounds):
        seconds = SHORTEST + (LONGEST - SHORTEST) * min(1.0, 1.5 * round_ / rounds)
        costs, *_ = roll_out(machine, model, generator, BATCH, seconds)
        loss = torch.log1p(costs).mean()  # a robot that falls is not to drown the others
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(model.parameters(), 0.5)
        optimiser.step()
        schedule.step()
        if round_ % (rounds // 20) == 0 or round_ + 1 == rounds:
            curve.append({"round": round_, "seconds": round(seconds, 3), "loss": round(loss.item(), 6)})
            print(curve[-1], flush=True)
    return model, curve


def evaluate(machine, model, seed):
    """Of 64 robots over ten seconds, by latency: how many fell, and how far from the commanded speed the others were, root mean square."""
    result = {}
    with torch.no_grad():
        for latency_ms in (10, 20, 40, 60, 80, 100):
            _, _, states, command = roll_out(machine, model, torch.Generator().manual_seed(seed + 1000), 64, 10.0, False, latency_ms // 5)
            fell = (states[:, :, 1].abs() > FELL).any(0)
            error = ((states[-250:, :, 0] - command[None, :, 0]) ** 2).mean(0).sqrt()
            result[f"{latency_ms} ms"] = {"fell": int(fell.sum()), "speed_error_m_per_s": round(float(error[~fell].mean()), 4) if bool((~fell).any()) else None}
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", type=Path, required=True, help="robot file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rounds", type=int, default=500, help="gradient steps")
    parser.add_argument("--output", type=Path, help="ONNX file to write (default: the one named by the robot file)")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    machine = balancer_model.load(arguments.robot)
    model, curve = train(machine, arguments.seed, arguments.rounds)
    layers = [(layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in model if isinstance(layer, torch.nn.Linear)]
    model_bytes = network.onnx_bytes(layers, machine.policy["input"], machine.policy["output"], "make_balancer")
    output = arguments.output or arguments.robot.parent / machine.policy["file"]
    output.write_bytes(model_bytes)
    with torch.no_grad():
        _, seen, _, _ = roll_out(machine, model, torch.Generator().manual_seed(arguments.seed + 2000), EXAMPLES, 1.0)
    examples = seen[25].numpy()
    report = {
        "schema": "takt.training/1",
        "command": f"nice -n 19 /usr/bin/python3 policy_host/training/make_balancer.py --robot config/balancer.yaml --seed {arguments.seed} --rounds {arguments.rounds}",
        "seed": arguments.seed,
        "versions": {"python": platform.python_version(), "torch": torch.__version__, "numpy": np.__version__,
                     "onnx": network.onnx.__version__, "machine": platform.machine()},
        "onnx_sha256": hashlib.sha256(model_bytes).hexdigest(),
        "configuration": machine.facts,
        "configuration_sha256": hashlib.sha256("\n".join(machine.facts).encode()).hexdigest(),
        "data": {"robots": BATCH, "rollouts": BATCH * arguments.rounds},
        "loss_curve": curve,
        "evaluation": evaluate(machine, model, arguments.seed),
        "examples": {"inputs": examples.tolist(), "outputs": network.evaluate(layers, examples).tolist()},
    }
    output.with_suffix(".training.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report["evaluation"], indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
