# SPDX-License-Identifier: Apache-2.0
"""The policy network and its ONNX form. Normalisation is folded into the first and last layer, so that the file takes
the observation exactly as the robot file lists it and gives targets relative to home."""
import numpy as np
import onnx
import torch
from onnx import TensorProto, helper, numpy_helper

HIDDEN = 256


def build(inputs, outputs, hidden=HIDDEN):
    return torch.nn.Sequential(torch.nn.Linear(inputs, hidden), torch.nn.ELU(), torch.nn.Linear(hidden, hidden),
                               torch.nn.ELU(), torch.nn.Linear(hidden, outputs))


class Normaliser:
    """Fixed affine maps around the network: features = matrix @ inputs + shift, actions = centre + spread * outputs."""

    def __init__(self, inputs, actions, sensor_columns):
        """`sensor_columns`: first column and width of each sensor sample, oldest sample first."""
        mix = np.eye(inputs.shape[1])
        for (older, width), (newer, _) in zip(sensor_columns, sensor_columns[1:]):
            # The target's motion between two samples, at a size that the network can see.
            for i in range(width):
                mix[older + i, older + i], mix[older + i, newer + i] = -1.0, 1.0
        mixed = inputs.astype(np.float64) @ mix.T
        deviation = mixed.std(axis=0) + 1e-6
        self.matrix = mix / deviation[:, None]
        self.shift = -mixed.mean(axis=0) / deviation
        self.centre, self.spread = actions.mean(axis=0), float(actions.std())

    def features(self, inputs):
        return (inputs @ self.matrix.T + self.shift).astype(np.float32)

    def outputs(self, actions):
        return ((actions - self.centre) / self.spread).astype(np.float32)


def folded_layers(network, normaliser):
    """[(weight, bias)] of the three layers, float32, taking raw inputs and giving actions."""
    layers = [(layer.weight.detach().numpy().astype(np.float64), layer.bias.detach().numpy().astype(np.float64))
              for layer in network if isinstance(layer, torch.nn.Linear)]
    (first, first_bias), middle, (last, last_bias) = layers
    layers = [(first @ normaliser.matrix, first_bias + first @ normaliser.shift), middle,
              (normaliser.spread * last, normaliser.centre + normaliser.spread * last_bias)]
    return [(weight.astype(np.float32), bias.astype(np.float32)) for weight, bias in layers]


def evaluate(layers, inputs, skip=None):
    """What the ONNX file computes, in float64: (batch, inputs) -> (batch, outputs). `skip` as in onnx_bytes."""
    values = inputs.astype(np.float64)
    for i, (weight, bias) in enumerate(layers):
        values = values @ weight.T.astype(np.float64) + bias
        if i + 1 < len(layers):
            values = np.where(values > 0, values, np.expm1(np.minimum(values, 0)))
    return values if skip is None else values + inputs.astype(np.float64) @ skip.T


def onnx_bytes(layers, input_name, output_name, name="reach", skip=None):
    """The file's bytes: a function of the weights and names alone, no time stamp, no path.

    `skip` (outputs, inputs): a fixed linear part of the inputs that is added to what the layers give.
    """
    nodes, weights, flowing = [], [], input_name
    for i, (weight, bias) in enumerate(layers):
        last = i + 1 == len(layers)
        weights += [numpy_helper.from_array(weight, f"layer{i}.weight"), numpy_helper.from_array(bias, f"layer{i}.bias")]
        linear = (output_name if skip is None else "path") if last else f"layer{i}.linear"
        nodes.append(helper.make_node("Gemm", [flowing, f"layer{i}.weight", f"layer{i}.bias"], [linear],
                                      name=f"layer{i}.gemm", transB=1))
        if not last:
            flowing = f"layer{i}.out"
            nodes.append(helper.make_node("Elu", [linear], [flowing], name=f"layer{i}.elu", alpha=1.0))
    if skip is not None:
        weights += [numpy_helper.from_array(skip.astype(np.float32), "skip.weight"),
                    numpy_helper.from_array(np.zeros(len(skip), np.float32), "skip.bias")]
        nodes += [helper.make_node("Gemm", [input_name, "skip.weight", "skip.bias"], ["skip"], name="skip.gemm", transB=1),
                  helper.make_node("Add", ["path", "skip"], [output_name], name="sum")]
    graph = helper.make_graph(
        nodes, name, [helper.make_tensor_value_info(input_name, TensorProto.FLOAT, [1, layers[0][0].shape[1]])],
        [helper.make_tensor_value_info(output_name, TensorProto.FLOAT, [1, layers[-1][0].shape[0]])], weights)
    model = helper.make_model(graph, producer_name="takt train_reach" if name == "reach" else f"takt {name}", opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 7
    onnx.checker.check_model(model)
    return model.SerializeToString()
