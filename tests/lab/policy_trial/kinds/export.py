# SPDX-License-Identifier: Apache-2.0
"""How networks become files here: exported by torch, scripted, or raised to what newer exporters write. Weights are random, of a seed
that the name decides, and batch-norm and normaliser statistics are no longer those of a network that saw nothing."""
import warnings
import zlib

import numpy as np
import onnx
import torch
from onnx import TensorProto, external_data_helper, helper, numpy_helper
from torch import nn

NEWEST_OF_TORCH = 17  # Debian's torch 1.13


def seeded(name, network, *arguments):
    torch.manual_seed(zlib.crc32(name.encode()))
    module = network(*arguments).eval()
    for buffer_name, buffer in module.named_buffers():
        if buffer_name.endswith("mean"):
            buffer.normal_(0, 0.3)
        if buffer_name.endswith("var") or buffer_name.endswith("std"):
            buffer.uniform_(0.5, 1.5)
    return module


def to_onnx(module, file, shapes, outputs=("actions",), opset=11, dynamic_batch=False):
    """`shapes`: of each input, by its name."""
    warnings.filterwarnings("ignore")
    inputs = list(shapes)
    batch = {name: {0: "batch"} for name in (*inputs, *outputs)} if dynamic_batch else {}
    with torch.no_grad():
        torch.onnx.export(module, tuple(torch.zeros(shape) for shape in shapes.values()), str(file), input_names=inputs, output_names=list(outputs),
                          opset_version=min(opset, NEWEST_OF_TORCH), dynamic_axes=batch)
    if opset > NEWEST_OF_TORCH:
        model = onnx.load(str(file))
        raise_opset(model, opset)
        onnx.save(model, str(file))


def to_torchscript(module, file):
    torch.jit.script(module).save(str(file))


def raise_opset(model, opset):
    """From 18 on the axes of a reduction are an input (onnx/onnx, docs/Changelog.md)."""
    for node in model.graph.node:
        axes = next((a for a in node.attribute if a.name == "axes"), None)
        if node.op_type.startswith("Reduce") and axes is not None:
            name = f"{node.output[0]}_axes"
            model.graph.initializer.append(numpy_helper.from_array(np.array(axes.ints, np.int64), name))
            node.input.append(name)
            node.attribute.remove(axes)
    model.opset_import[0].version = opset
    model.ir_version = 8 if opset < 19 else 9 if opset < 21 else 10


def weights_beside(file):
    """In FILE.data, as torch.onnx.export writes them since 2.9 (dynamo=True is its default since; external_data too)."""
    model = onnx.load(str(file))
    external_data_helper.convert_model_to_external_data(model, all_tensors_to_one_file=True, location=file.name + ".data", size_threshold=0)
    onnx.save(model, str(file))


def with_metadata(file, metadata):
    model = onnx.load(str(file))
    helper.set_model_props(model, metadata)
    onnx.save(model, str(file))


def in_float16(file):
    """Inputs and outputs stay float32, as onnxconverter-common's convert_float_to_float16(keep_io_types=True) leaves them."""
    model = onnx.load(str(file))
    graph = model.graph
    for tensor in graph.initializer:
        if tensor.data_type == TensorProto.FLOAT:
            tensor.CopyFrom(numpy_helper.from_array(numpy_helper.to_array(tensor).astype(np.float16), tensor.name))
    inputs, outputs = {i.name: i.name + "_half" for i in graph.input}, {o.name: o.name + "_half" for o in graph.output}
    for node in graph.node:
        node.input[:] = [inputs.get(name, name) for name in node.input]
        node.output[:] = [outputs.get(name, name) for name in node.output]
    del graph.value_info[:]
    before = [helper.make_node("Cast", [name], [half], to=TensorProto.FLOAT16) for name, half in inputs.items()]
    after = [helper.make_node("Cast", [half], [name], to=TensorProto.FLOAT) for name, half in outputs.items()]
    nodes = [*before, *graph.node, *after]
    del graph.node[:]
    graph.node.extend(nodes)
    onnx.save(model, str(file))


def quantised(file):
    """Weights in int8 and activations between QuantizeLinear and DequantizeLinear: the QDQ form of onnxruntime.quantization.quantize_static."""
    model = onnx.load(str(file))
    graph, nodes = model.graph, []
    constant = lambda name, value: (graph.initializer.append(numpy_helper.from_array(value, name)), name)[1]
    constant("activation_scale", np.array(1 / 32, np.float32))
    constant("zero", np.array(0, np.int8))
    weights = {tensor.name: tensor for tensor in graph.initializer if len(tensor.dims) == 2}
    for node in graph.node:
        if node.op_type == "Gemm":
            for i, name in enumerate(node.input[:2]):
                if name in weights:
                    values = numpy_helper.to_array(weights[name])
                    scale = np.array(np.abs(values).max() / 127, np.float32)
                    constant(name + "_int8", np.rint(values / scale).astype(np.int8))
                    nodes.append(helper.make_node("DequantizeLinear", [name + "_int8", constant(name + "_scale", scale), "zero"], [name + "_real"]))
                    node.input[i] = name + "_real"
                else:
                    nodes.append(helper.make_node("QuantizeLinear", [name, "activation_scale", "zero"], [f"{node.output[0]}_int8"]))
                    nodes.append(helper.make_node("DequantizeLinear", [f"{node.output[0]}_int8", "activation_scale", "zero"], [f"{node.output[0]}_real"]))
                    node.input[i] = f"{node.output[0]}_real"
        nodes.append(node)
    nodes = [onnx.NodeProto.FromString(node.SerializeToString()) for node in nodes]
    del graph.node[:]
    graph.node.extend(nodes)
    for tensor in weights.values():
        graph.initializer.remove(tensor)
    onnx.save(model, str(file))


def mlp(*widths, activation=nn.ELU):
    layers = []
    for into, out in zip(widths, widths[1:]):
        layers += [nn.Linear(into, out), activation()]
    return nn.Sequential(*layers[:-1])
