# SPDX-License-Identifier: Apache-2.0
"""The ResNet (He et al. 2015) that looks at a policy's images, as torchvision lays out its weights: everything before the average pooling."""
from typing import Callable, Dict, List, Tuple

from takt.lerobot._checkpoint import Tensors
from takt.lerobot._graph import Array, Graph

# Blocks of each layer, and whether a block has three convolutions.
BACKBONES: Dict[str, Tuple[List[int], bool]] = {"resnet18": ([2, 2, 2, 2], False), "resnet34": ([3, 4, 6, 3], False), "resnet50": ([3, 4, 6, 3], True),
                                                "resnet101": ([3, 4, 23, 3], True), "resnet152": ([3, 8, 36, 3], True)}
_EPSILON = 1e-5  # of batch and group norms alike

Map = Tuple[str, Tuple[int, int, int, int]]  # a tensor, and (batch, channels, height, width)


def _size(extent: int, kernel: int, stride: int) -> int:
    return (extent + 2 * (kernel // 2) - kernel) // stride + 1


class ResNet:
    """`name(part)` is the weights' name of "conv1", "bn1" or "layer3.0.conv2". `grouped`: group norm, of 16 channels each, in place of batch norm."""

    def __init__(self, graph: Graph, weights: Tensors, backbone: str, name: Callable[[str], str], grouped: bool) -> None:
        self._graph, self._weights, self._name, self._grouped = graph, weights, name, grouped
        self._blocks, self._three = BACKBONES[backbone]
        self.channels = 2048 if self._three else 512

    def _convolved(self, x: Map, conv: str, norm: str, out: int, kernel: int, stride: int) -> Map:
        tensor, (batch, channels, height, width) = x
        shape = (batch, out, _size(height, kernel, stride), _size(width, kernel, stride))
        key, at = self._name(conv), self._name(norm)
        weight = self._weights.take(f"{key}.weight", out, channels, kernel, kernel)
        gain, shift = self._weights.take(f"{at}.weight", out), self._weights.take(f"{at}.bias", out)
        window = {"kernel_shape": [kernel] * 2, "strides": [stride] * 2, "pads": [kernel // 2] * 4}
        if self._grouped:
            y = self._graph.op("Conv", tensor, self._graph.constant(weight, f"{key}.weight"), **window)
            spread = [self._graph.constant(values.reshape(-1, 1, 1), f"{at}.{part}") for part, values in (("weight", gain), ("bias", shift))]
            return self._graph.group_norm(y, shape, out // 16, spread[0], spread[1], _EPSILON), shape
        mean, variance = self._weights.take(f"{at}.running_mean", out), self._weights.take(f"{at}.running_var", out)
        self._weights.drop(f"{at}.num_batches_tracked")
        gain = gain / (variance + _EPSILON) ** 0.5
        folded: Array = weight * gain[:, None, None, None]
        weights = self._graph.constant(folded, f"{key}.weight"), self._graph.constant(shift - mean * gain, f"{key}.bias")
        return self._graph.op("Conv", tensor, *weights, **window), shape

    def _relu(self, x: Map) -> Map:
        return self._graph.op("Relu", x[0]), x[1]

    def _block(self, x: Map, part: str, out: int, stride: int) -> Map:
        relu, wide = self._relu, out * 4 if self._three else out
        if self._three:
            y = relu(self._convolved(x, f"{part}.conv1", f"{part}.bn1", out, 1, 1))
            y = relu(self._convolved(y, f"{part}.conv2", f"{part}.bn2", out, 3, stride))
            y = self._convolved(y, f"{part}.conv3", f"{part}.bn3", wide, 1, 1)
        else:
            y = relu(self._convolved(x, f"{part}.conv1", f"{part}.bn1", out, 3, stride))
            y = self._convolved(y, f"{part}.conv2", f"{part}.bn2", out, 3, 1)
        if stride != 1 or x[1][1] != wide:
            x = self._convolved(x, f"{part}.downsample.0", f"{part}.downsample.1", wide, 1, stride)
        return relu((self._graph.op("Add", y[0], x[0]), y[1]))

    def __call__(self, x: Map) -> Map:
        tensor, shape = self._convolved(x, "conv1", "bn1", 64, 7, 2)
        tensor = self._graph.op("MaxPool", self._graph.op("Relu", tensor), kernel_shape=[3, 3], strides=[2, 2], pads=[1, 1, 1, 1])
        y: Map = tensor, (*shape[:2], _size(shape[2], 3, 2), _size(shape[3], 3, 2))
        for layer, count in enumerate(self._blocks):
            for block in range(count):
                y = self._block(y, f"layer{layer + 1}.{block}", 64 << layer, 2 if layer and not block else 1)
        return y
