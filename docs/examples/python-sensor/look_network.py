#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The network of look.onnx in Python, layer by layer in numpy: the arm turns after the spot of camera.py. python3-onnx reads its weights."""
import numpy as np
import onnx.numpy_helper

import takt


class Network:
    def __init__(self, file):
        self.weights = {weight.name: onnx.numpy_helper.to_array(weight) for weight in onnx.load(file).graph.initializer}

    def layer(self, name):
        return self.weights[name + ".weight"], self.weights[name + ".bias"]

    def convolved(self, image, name):
        """Every second pixel, then what is above 0; (channels, height, width)."""
        weight, bias = self.layer(name)
        size = weight.shape[-1]
        padded = np.pad(image, ((0, 0), *2 * [(size // 2, size // 2)]))
        windows = np.lib.stride_tricks.sliding_window_view(padded, (size, size), axis=(1, 2))[:, ::2, ::2]
        return np.maximum(np.einsum("chwij,ocij->ohw", windows, weight) + bias[:, None, None], 0)

    def linear(self, x, name):
        weight, bias = self.layer(name)
        return weight @ x + bias

    def __call__(self, from_home, image):
        """(96,): 16 steps of 6 joints, rad from home. `from_home` (6,), rad; `image` (48, 64), from 0 to 1."""
        seen = image[None]
        for name in ("layer0", "layer2", "layer4"):
            seen = self.convolved(seen, name)
        place = self.linear(np.maximum(self.linear(np.ravel(seen), "layer7"), 0), "layer9")
        return self.linear(np.concatenate([place, from_home]), "path")


if __name__ == "__main__":
    spec = takt.Policy(observation={"q": takt.joints("q"), "top": takt.image("cam0", shape=(48, 64, 1), max_age="100 ms")},
                       action=takt.chunk("q", steps=16, step="10 ms"))
    with takt.connect("looks.yaml", spec) as robot:
        network = Network(robot.policy_file)
        for obs in robot:
            with obs.infer():
                path = network(obs.q[0] - robot.home, obs.top[:, :, 0] / np.float32(255))
            obs.publish(q=robot.home + path.reshape(16, 6))
