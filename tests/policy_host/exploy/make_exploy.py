#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes ONNX files of a whole environment as exploy's exporter does: make_exploy.py FOLDER

step.onnx   one step of the policy: the observation computed of the robot's state, a network, its action made joint targets
whole.onnx  the same as it is handed out: an If on ctx.step_count, every DECIMATION-th step of the simulation infers, the others turn the
            action that is remembered into targets again
Two joints of three are commanded; of the base's state orientation and angular velocity are read; the last action and a history of three
observations are memory. Weights from a fixed seed, values of the same names in both branches. Opset 20.
"""
import json
import pathlib
import sys

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

DECIMATION, SIM_DT = 4, 0.005
JOINTS, COMMANDED = ["hip", "knee", "ankle"], ["ankle", "hip"]
DEFAULT = np.array([[0.1, -0.2, 0.3]], np.float32)
PICKED = np.array([JOINTS.index(joint) for joint in COMMANDED], np.int64)
NOW, PAST, HIDDEN = 3 + 3 + 3 + 3 + 3 + 2, 3, 32
INPUTS = {"obj.robot.joints.pos": [1, 3], "obj.robot.joints.vel": [1, 3], "obj.robot.pelvis.w_Q_b": [1, 4],
          "obj.robot.pelvis.ang_vel_b_rt_w_in_b": [1, 3], "cmd.se2_velocity.base": [1, 3], "memory.actions.in": [1, 2],
          "memory.history.in": [PAST, 1, NOW]}
TARGETS = "output.joint_targets.legs"
OUTPUTS = {"actions": [1, 2], "obs": [1, PAST * NOW], f"{TARGETS}.pos": [1, 2], f"{TARGETS}.vel": [1, 2], f"{TARGETS}.effort": [1, 2],
           "memory.actions.out": [1, 2], "memory.history.out": [PAST, 1, NOW]}
METADATA = {"exploy_version": json.dumps("0.3.1"), "decimation": str(DECIMATION), "sim_dt": str(SIM_DT), "update_rate": str(1 / SIM_DT),
            "base_names": json.dumps({"robot": "pelvis"}), "obj.robot.joints": json.dumps({"joint_names": JOINTS}),
            "cmd.se2_velocity.base": json.dumps({"ranges": {"lin_vel_x": [-1, 1], "lin_vel_y": [-0.5, 0.5], "ang_vel_z": [-2, 2]}}),
            TARGETS: json.dumps({"names": COMMANDED, "stiffness": [40, 60], "damping": [2, 3]})}


class Graph:
    def __init__(self, name, random):
        self.name, self.random, self.nodes, self.constants = name, random, [], []

    def constant(self, name, values):
        self.constants.append(numpy_helper.from_array(values, name))
        return name

    def make(self, op, to, *sources, **attributes):
        self.nodes.append(helper.make_node(op, list(sources), [to], **attributes))
        return to

    def layer(self, to, source, width_in, width_out):
        weights = (self.random.standard_normal((width_in, width_out)) / np.sqrt(width_in)).astype(np.float32)
        bias = (0.1 * self.random.standard_normal(width_out)).astype(np.float32)
        return self.make("Gemm", to, source, self.constant(to + ".w", weights), self.constant(to + ".b", bias))

    def part(self, to, source, begin, end):
        bounds = [self.constant(f"{to}.{what}", np.array([at], np.int64)) for what, at in (("begin", begin), ("end", end), ("axis", 1))]
        return self.make("Slice", to, source, *bounds)

    def projected_gravity(self):
        """What gravity's direction is in the base: the world's -z, turned back by a unit quaternion w x y z."""
        w, x, y, z = (self.part(f"q.{name}", "obj.robot.pelvis.w_Q_b", i, i + 1) for i, name in enumerate("wxyz"))
        product = lambda to, a, b: self.make("Mul", to, a, b)
        minus_two = self.constant("minus_two", np.array([[-2]], np.float32))
        gx = product("g.x", minus_two, self.make("Sub", "g.x.half", product("q.xz", x, z), product("q.wy", w, y)))
        gy = product("g.y", minus_two, self.make("Add", "g.y.half", product("q.yz", y, z), product("q.wx", w, x)))
        squares = self.make("Add", "q.xx+yy", product("q.xx", x, x), product("q.yy", y, y))
        one = self.constant("one", np.array([[1]], np.float32))
        gz = self.make("Neg", "g.z", self.make("Add", "g.z.minus", one, product("g.z.part", minus_two, squares)))
        return self.make("Concat", "gravity", gx, gy, gz, axis=1)

    def infer(self):
        """Observation, history, network. Returns the action's name."""
        offset = self.make("Sub", "joints.offset", "obj.robot.joints.pos", "default")
        now = self.make("Concat", "now", "obj.robot.pelvis.ang_vel_b_rt_w_in_b", self.projected_gravity(), "cmd.se2_velocity.base", offset,
                        "obj.robot.joints.vel", "memory.actions.in", axis=1)
        first, last, axis = (self.constant(f"past.{name}", np.array([at], np.int64)) for name, at in (("first", 1), ("last", PAST), ("axis", 0)))
        older = self.make("Slice", "older", "memory.history.in", first, last, axis)
        newest = self.make("Reshape", "newest", now, self.constant("newest.shape", np.array([1, 1, NOW], np.int64)))
        self.make("Concat", "memory.history.out", older, newest, axis=0)
        flat = self.constant("obs.shape", np.array([1, -1], np.int64))
        self.make("Reshape", "obs", "memory.history.out", flat)
        hidden = self.make("Elu", "hidden", self.layer("hidden.sum", "obs", PAST * NOW, HIDDEN))
        self.make("Tanh", "actions", self.layer("actions.sum", hidden, HIDDEN, 2))
        return self.make("Identity", "memory.actions.out", "actions")

    def remember(self):
        for name in ("actions", "obs"):
            self.constant(name + ".zeros", np.zeros(OUTPUTS[name], np.float32))
            self.make("Identity", name, name + ".zeros")
        self.make("Identity", "memory.history.out", "memory.history.in")
        return self.make("Identity", "memory.actions.out", "memory.actions.in")

    def apply(self, action):
        picked = self.constant("picked", PICKED)
        step = self.make("Mul", "action.step", action, self.constant("action.scale", np.array([[0.5]], np.float32)))
        target = self.make("Add", f"{TARGETS}.pos", step, self.make("Gather", "default.picked", "default", picked, axis=1))
        self.constant("still", np.zeros((1, 2), np.float32))
        self.make("Identity", f"{TARGETS}.vel", "still")
        error = self.make("Sub", "error", target, self.make("Gather", "q.picked", "obj.robot.joints.pos", picked, axis=1))
        self.make("Mul", f"{TARGETS}.effort", error, self.constant("effort.gain", np.array([[1.5]], np.float32)))

    def proto(self, with_inputs):
        value = lambda item: helper.make_tensor_value_info(item[0], TensorProto.FLOAT, item[1])
        inputs = list(map(value, INPUTS.items())) if with_inputs else []
        return helper.make_graph(self.nodes, self.name, inputs, list(map(value, OUTPUTS.items())), self.constants)


def environment(infers, with_inputs):
    graph = Graph("default" if infers else "process_actions", np.random.default_rng(3))
    graph.constant("default", DEFAULT)
    graph.apply(graph.infer() if infers else graph.remember())
    return graph.proto(with_inputs)


def save(graph, file):
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 20)], ir_version=9)
    helper.set_model_props(model, METADATA)
    onnx.save(model, file)


def whole():
    value = lambda item: helper.make_tensor_value_info(item[0], TensorProto.FLOAT, item[1])
    count = helper.make_tensor_value_info("ctx.step_count", TensorProto.INT32, [])
    constants = [helper.make_tensor(name, TensorProto.INT32, (), [number]) for name, number in (("decimation", DECIMATION), ("zero", 0))]
    nodes = [helper.make_node("Mod", ["ctx.step_count", "decimation"], ["is_event"]), helper.make_node("Equal", ["is_event", "zero"], ["cond"]),
             helper.make_node("If", ["cond"], list(OUTPUTS), then_branch=environment(True, False), else_branch=environment(False, False))]
    return helper.make_graph(nodes, "whole", [count, *map(value, INPUTS.items())], list(map(value, OUTPUTS.items())), constants)


def main(folder):
    save(environment(True, True), pathlib.Path(folder) / "step.onnx")
    save(whole(), pathlib.Path(folder) / "whole.onnx")


if __name__ == "__main__":
    main(*sys.argv[1:])
