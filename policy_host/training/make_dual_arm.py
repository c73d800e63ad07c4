# SPDX-License-Identifier: Apache-2.0
"""Makes the two-arm demo's policy of the one-arm demo's: two copies of the trained network, one per arm.

    /usr/bin/python3 policy_host/training/make_dual_arm.py config/arm6_reach.onnx config/dual_arm12_reach.onnx

Each arm sees its own joints and the one target, in its own base's frame, and answers for its own joints. Input (1, 42):
q - home 12, dq 12, target 2 x 3, last action 12. Output (1, 192): 16 steps of 12 joint positions.
"""
import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

JOINTS, STEPS, OPSET = 6, 16, 13


def inputs_of(arm):
    """Where the one-arm network's 24 inputs stand among the 42."""
    own = np.arange(JOINTS) + arm * JOINTS
    return np.concatenate([own, 12 + own, 24 + np.arange(6), 30 + own])


def copy_for(arm, one, initializers):
    """The nodes of one arm: choose its inputs, run the network, shape its output as (1, steps, joints)."""
    name = f"arm{arm}."
    initializers.append(numpy_helper.from_array(inputs_of(arm).astype(np.int64), name + "inputs"))
    nodes = [helper.make_node("Gather", ["obs", name + "inputs"], [name + "obs"], axis=1)]
    renamed = {"obs": name + "obs", "actions": name + "actions"}
    for node in one.graph.node:
        copy = onnx.NodeProto()
        copy.CopyFrom(node)
        weights = {tensor.name for tensor in one.graph.initializer}
        copy.input[:] = [renamed.get(i, i if i in weights else name + i) for i in node.input]
        copy.output[:] = [renamed.get(o, name + o) for o in node.output]
        copy.name = name + (node.name or node.output[0])
        nodes.append(copy)
    nodes.append(helper.make_node("Reshape", [name + "actions", "one_arm"], [name + "steps"]))
    return nodes


def main(source, destination):
    one = onnx.load(source)
    initializers = list(one.graph.initializer)
    initializers.append(numpy_helper.from_array(np.array([1, STEPS, JOINTS], np.int64), "one_arm"))
    initializers.append(numpy_helper.from_array(np.array([1, 2 * STEPS * JOINTS], np.int64), "both_arms"))
    nodes = copy_for(0, one, initializers) + copy_for(1, one, initializers)
    nodes.append(helper.make_node("Concat", ["arm0.steps", "arm1.steps"], ["steps"], axis=2))
    nodes.append(helper.make_node("Reshape", ["steps", "both_arms"], ["actions"]))
    graph = helper.make_graph(nodes, "dual_arm_reach",
                              [helper.make_tensor_value_info("obs", TensorProto.FLOAT, [1, 42])],
                              [helper.make_tensor_value_info("actions", TensorProto.FLOAT, [1, 192])], initializers)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], producer_name="takt")
    model.ir_version = one.ir_version
    onnx.checker.check_model(model)
    onnx.save(model, destination)


if __name__ == "__main__":
    main(*sys.argv[1:])
