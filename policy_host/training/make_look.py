#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains a policy that looks: a small convolutional network finds a bright spot in an image, and the arm turns after it.

The network learns where the spot is, of images that are drawn here: a spot of 6 to 12 pixels, as bright as it happens,
on a noisy, uneven ground. What follows is fixed: base and wrist turn with the spot's place, and the chunk leads there
from where the arm is. Input `obs` is q - home, rad; input `image` 1 x 48 x 64 from 0 to 1.
Reproducible: one thread, one seed, no time in the output file. Writes the ONNX file and a report beside it.

    nice -n 19 /usr/bin/python3 policy_host/training/make_look.py
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
from onnx import TensorProto, helper, numpy_helper

HEIGHT, WIDTH = 48, 64
JOINTS, STEPS, STEP_PERIOD, TIME_CONSTANT = 6, 16, 0.01, 0.25  # s
BASE_YAW, WRIST_PITCH = 0, 4
TURN = {BASE_YAW: 0.3, WRIST_PITCH: 0.2}  # rad from one edge of the image to the other
BATCH = 128


def draw(rng, count):
    """Images from 0 to 1 (count, 1, HEIGHT, WIDTH), and the spots' centres from -1 to 1: column, row."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    half = rng.integers(3, 7, count)
    row, column = rng.uniform(half, HEIGHT - half), rng.uniform(half, WIDTH - half)
    slope = rng.uniform(-0.1, 0.1, (2, count, 1, 1))
    ground = rng.uniform(0.02, 0.3, (count, 1, 1)) + slope[0] * (rows / HEIGHT - 0.5) + slope[1] * (columns / WIDTH - 0.5)
    at = lambda values: values[:, None, None]
    spot = (np.abs(rows - at(row)) < at(half)) & (np.abs(columns - at(column)) < at(half))
    image = np.where(spot, rng.uniform(0.6, 1.0, (count, 1, 1)), ground) + rng.normal(0, 0.03, (count, HEIGHT, WIDTH))
    # As a camera gives them.
    image = np.round(np.clip(image, 0, 1) * 255) / 255
    return image[:, None].astype(np.float32), place(column, row)


def place(column, row):
    return np.stack([2 * column / (WIDTH - 1) - 1, 2 * row / (HEIGHT - 1) - 1], axis=-1).astype(np.float32)


def build():
    def halved(channels, size):
        return torch.nn.Conv2d(channels, 8, size, stride=2, padding=size // 2)
    return torch.nn.Sequential(halved(1, 5), torch.nn.ReLU(), halved(8, 3), torch.nn.ReLU(), halved(8, 3), torch.nn.ReLU(), torch.nn.Flatten(),
                               torch.nn.Linear(8 * HEIGHT // 8 * WIDTH // 8, 32), torch.nn.ReLU(), torch.nn.Linear(32, 2))


def train(seed, steps):
    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    model = build()
    optimiser = torch.optim.Adam(model.parameters(), lr=2e-3)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    curve, total = [], 0.0
    for step in range(1, steps + 1):
        images, places = draw(rng, BATCH)
        loss = torch.nn.functional.mse_loss(model(torch.from_numpy(images)), torch.from_numpy(places))
        optimiser.zero_grad()
        loss.backward()
        optimiser.step()
        schedule.step()
        total += loss.item()
        if step % (steps // 10) == 0:
            curve.append({"step": step, "rms_pixels": float(np.sqrt(total / (steps // 10))) * (WIDTH - 1) / 2})
            print(curve[-1], flush=True)
            total = 0.0
    return model, curve


def path_weights():
    """(STEPS * JOINTS, 2 + JOINTS): each step's targets of what the network found and where the joints are."""
    weights = np.zeros((STEPS, JOINTS, 2 + JOINTS))
    for step in range(STEPS):
        left = np.exp(-(step + 1) * STEP_PERIOD / TIME_CONSTANT)  # of the way
        weights[step, :, 2:] = left * np.eye(JOINTS)
        for found, joint in enumerate((BASE_YAW, WRIST_PITCH)):
            weights[step, joint, found] = (1 - left) * TURN[joint] / 2
    return weights.reshape(STEPS * JOINTS, 2 + JOINTS).astype(np.float32)


def onnx_bytes(model):
    nodes, weights, flowing = [], [], "image"

    def weight(name, values):
        weights.append(numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    for i, layer in enumerate(model):
        out = f"layer{i}"
        if isinstance(layer, torch.nn.Conv2d):
            given = [flowing, weight(f"{out}.weight", layer.weight.detach().numpy()), weight(f"{out}.bias", layer.bias.detach().numpy())]
            nodes.append(helper.make_node("Conv", given, [out], name=out, kernel_shape=list(layer.kernel_size), strides=list(layer.stride),
                                          pads=2 * list(layer.padding)))
        elif isinstance(layer, torch.nn.Linear):
            given = [flowing, weight(f"{out}.weight", layer.weight.detach().numpy()), weight(f"{out}.bias", layer.bias.detach().numpy())]
            nodes.append(helper.make_node("Gemm", given, [out], name=out, transB=1))
        else:
            nodes.append(helper.make_node("Relu" if isinstance(layer, torch.nn.ReLU) else "Flatten", [flowing], [out], name=out))
        flowing = out
    nodes += [helper.make_node("Concat", [flowing, "obs"], ["found"], name="found", axis=1),
              helper.make_node("Gemm", ["found", weight("path.weight", path_weights()),
                                        weight("path.bias", np.zeros(STEPS * JOINTS, np.float32))], ["actions"], name="path", transB=1)]
    value = lambda name, shape: helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
    graph = helper.make_graph(nodes, "look", [value("obs", [1, JOINTS]), value("image", [1, 1, HEIGHT, WIDTH])],
                              [value("actions", [1, STEPS * JOINTS])], weights)
    file = helper.make_model(graph, producer_name="takt make_look", opset_imports=[helper.make_opsetid("", 13)])
    file.ir_version = 7
    onnx.checker.check_model(file)
    return file.SerializeToString()


def example(model, column, row, q):
    """A spot of 8 x 8 pixels of 240 on 16, as docs/examples/python-sensor/camera.py draws it, from this column and row on."""
    image = np.full((HEIGHT, WIDTH), 16, np.uint8)
    image[row:row + 8, column:column + 8] = 240
    with torch.no_grad():
        found = model(torch.from_numpy(image[None, None].astype(np.float32) / 255)).numpy()[0]
    outputs = path_weights() @ np.concatenate([found, np.asarray(q, np.float32)])
    return {"column": column, "row": row, "q": q, "outputs": [float(value) for value in outputs]}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--steps", type=int, default=3000, help="gradient steps")
    parser.add_argument("--output", type=Path, default=Path("docs/examples/python-sensor/look.onnx"), help="ONNX file to write")
    arguments = parser.parse_args()
    torch.set_num_threads(1)
    torch.use_deterministic_algorithms(True)
    model, curve = train(arguments.seed, arguments.steps)
    model.eval()
    images, places = draw(np.random.default_rng(arguments.seed + 1000), 4000)
    with torch.no_grad():
        wrong = np.abs(model(torch.from_numpy(images)).numpy() - places) * (np.array([WIDTH, HEIGHT]) - 1) / 2
    file = onnx_bytes(model)
    arguments.output.write_bytes(file)
    report = {
        "schema": "takt.training/1",
        "command": f"nice -n 19 /usr/bin/python3 policy_host/training/make_look.py --seed {arguments.seed} --steps {arguments.steps}",
        "seed": arguments.seed,
        "versions": {"python": platform.python_version(), "torch": torch.__version__, "numpy": np.__version__,
                     "onnx": onnx.__version__, "machine": platform.machine()},
        "onnx_sha256": hashlib.sha256(file).hexdigest(),
        "data": {"images": arguments.steps * BATCH},
        "loss_curve": curve,
        "evaluation": {"images": len(images), "median_pixels": float(np.median(wrong)), "p95_pixels": float(np.quantile(wrong, 0.95)),
                       "max_pixels": float(wrong.max())},
        "examples": [example(model, column, row, q) for column, row, q in
                     ((8, 20, [0.0] * 6), (28, 20, [0.1, 0.0, 0.0, 0.0, -0.1, 0.0]), (48, 20, [0.0, 0.2, -0.1, 0.0, 0.3, 0.05]), (30, 36, [0.0] * 6))],
    }
    arguments.output.with_suffix(".training.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(report["evaluation"], indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
