#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Exports the published TorchScript policies of a folder the way their authors' tools would, as ONNX files.

usage: published_policies.py SHARED_POLICIES FOLDER [beside]
b2.onnx and himloco.onnx (rl_sar), g1_lstm.onnx (unitree_rl_gym, its state as inputs and outputs) and
g1_lstm_without_state.onnx, which must be refused. With `beside` FOLDER becomes a copy of SHARED_POLICIES in which each stands beside the
TorchScript file that it is of, under its name. Exit status 77: PyTorch or a policy is not there.
"""

import pathlib
import shutil
import sys
import warnings

try:
    import onnx  # noqa: F401  (the exporter needs it)
    import torch
except ImportError as error:
    print(f"cannot export policies: {error}", file=sys.stderr)
    sys.exit(77)


class WithState(torch.nn.Module):
    """The LSTM of a TorchScript policy that keeps its state in buffers, with that state handed in and out."""

    def __init__(self, scripted):
        super().__init__()
        weights = dict(scripted.named_parameters())
        self.memory = torch.nn.LSTM(weights["memory.weight_ih_l0"].shape[1], weights["memory.weight_hh_l0"].shape[1])
        self.memory.load_state_dict({k[7:]: v for k, v in weights.items() if k.startswith("memory.")})
        layers = sorted({int(name.split(".")[1]) for name in weights if name.startswith("actor.")})
        linear = []
        for i in layers:
            w = weights[f"actor.{i}.weight"]
            linear += [torch.nn.Linear(w.shape[1], w.shape[0]), torch.nn.ELU()]
            linear[-2].load_state_dict({k: weights[f"actor.{i}.{k}"] for k in ("weight", "bias")})
        self.actor = torch.nn.Sequential(*linear[:-1])

    def forward(self, obs, h_in, c_in):
        out, (h, c) = self.memory(obs.unsqueeze(0), (h_in, c_in))
        return self.actor(out.squeeze(0)), h, c


class WithoutState(torch.nn.Module):
    def __init__(self, policy):
        super().__init__()
        self.policy = policy

    def forward(self, obs):
        state = torch.zeros(1, 1, self.policy.memory.hidden_size)
        return self.policy(obs, state, state)[0]


def export(net, shapes, path, inputs, outputs, opset=11):
    torch.onnx.export(net, tuple(torch.zeros(shape) for shape in shapes), str(path), opset_version=opset,
                      input_names=inputs, output_names=outputs)


def main():
    policies, folder = map(pathlib.Path, sys.argv[1:3])
    names = ("rl_sar_b2/policy.pt", "rl_sar_go2_himloco/himloco.pt", "unitree_rl_gym_g1/motion.pt")
    if not all((policies / name).exists() for name in names):
        sys.exit(77)
    if sys.argv[3:] == ["beside"]:
        shutil.copytree(policies, folder, copy_function=shutil.copyfile)
        for made in (folder, *folder.iterdir()):
            made.chmod(0o755)
        b2_file, himloco_file, g1_file = (folder / pathlib.Path(name).with_suffix(".onnx") for name in names)
    else:
        b2_file, himloco_file, g1_file = folder / "b2.onnx", folder / "himloco.onnx", folder / "g1_lstm.onnx"
    warnings.simplefilter("ignore")
    torch.set_num_threads(1)
    b2, himloco, g1 = (torch.jit.load(str(policies / name), map_location="cpu").eval() for name in names)
    export(b2, [(1, 45)], b2_file, ["obs"], ["actions"])
    export(himloco, [(1, 270)], himloco_file, ["obs"], ["actions"])
    lstm = WithState(g1).eval()
    state = (1, 1, lstm.memory.hidden_size)
    obs = torch.randn(5, 1, lstm.memory.input_size)
    h = c = torch.zeros(state)
    for one in obs:  # the same numbers as the original, or the judge would judge something else
        actions, h, c = lstm(one, h, c)
        assert torch.allclose(actions, g1(one), atol=1e-5), "the rebuilt network is another one"
    export(lstm, [(1, obs.shape[2]), state, state], g1_file, ["obs", "h_in", "c_in"], ["actions", "h_out", "c_out"])
    export(WithoutState(lstm).eval(), [(1, obs.shape[2])], g1_file.with_name(g1_file.stem + "_without_state.onnx"), ["obs"], ["actions"])


main()
