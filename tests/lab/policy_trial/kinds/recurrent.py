# SPDX-License-Identifier: Apache-2.0
"""Actors with a memory: state outside (inputs and outputs) and inside (a TorchScript module's buffers)."""
import torch
from torch import nn

from export import mlp


class StateOutside(nn.Module):
    """isaac-sim/IsaacLab, isaaclab_rl/rsl_rl/exporter.py (_OnnxPolicyExporter.forward_lstm): obs, h_in, c_in -> actions, h_out, c_out."""

    def __init__(self, into, hidden, actor, out):
        super().__init__()
        self.rnn, self.actor = nn.LSTM(into, hidden), mlp(hidden, *actor, out)

    def forward(self, obs, h_in, c_in):
        x, (h, c) = self.rnn(obs.unsqueeze(0), (h_in, c_in))
        return self.actor(x.squeeze(0)), h, c


class StateInside(nn.Module):
    """leggedrobotics/legged_gym, legged_gym/utils/helpers.py (PolicyExporterLSTM), which Unitree's unitree_rl_gym keeps: reset_memory() forgets."""

    def __init__(self, outside):
        super().__init__()
        self.actor, self.memory = outside.actor, outside.rnn
        for name in ("hidden_state", "cell_state"):
            self.register_buffer(name, torch.zeros(self.memory.num_layers, 1, self.memory.hidden_size))

    def forward(self, x):
        out, (h, c) = self.memory(x.unsqueeze(0), (self.hidden_state, self.cell_state))
        self.hidden_state[:] = h
        self.cell_state[:] = c
        return self.actor(out.squeeze(0))

    @torch.jit.export
    def reset_memory(self):
        self.hidden_state[:] = 0.0
        self.cell_state[:] = 0.0


class StateInsideReset(StateInside):
    """_TorchPolicyExporter of Isaac Lab: the same, forgetting by reset()."""

    @torch.jit.export
    def reset(self):
        self.hidden_state[:] = 0.0
        self.cell_state[:] = 0.0


class WithoutState(nn.Module):
    """torch.onnx.export of such a module as it stands: every inference begins from zeros. It must be refused."""

    def __init__(self, outside):
        super().__init__()
        self.outside = outside

    def forward(self, obs):
        state = torch.zeros(1, 1, self.outside.rnn.hidden_size)
        return self.outside(obs, state, state)[0]


class Gru(nn.Module):
    """The same exporter's other kind of memory, rnn_type gru: one state."""

    def __init__(self):
        super().__init__()
        self.rnn, self.actor = nn.GRU(48, 128), mlp(128, 128, 64, 12)

    def forward(self, obs, h_in):
        x, h = self.rnn(obs.unsqueeze(0), h_in)
        return self.actor(x.squeeze(0)), h


class LayerNormLstm(nn.Module):
    """An LSTM cell with layer norm on its gates, written out (no LSTM node): state of two dimensions."""

    def __init__(self, into=48, hidden=128):
        super().__init__()
        self.gates, self.norm, self.cell_norm, self.actor = nn.Linear(into + hidden, 4 * hidden), nn.LayerNorm(4 * hidden), nn.LayerNorm(hidden), mlp(hidden, 64, 12)

    def forward(self, obs, h_in, c_in):
        i, f, g, o = self.norm(self.gates(torch.cat((obs, h_in), dim=-1))).chunk(4, dim=-1)
        c = torch.sigmoid(f + 1) * c_in + torch.sigmoid(i) * torch.tanh(g)
        h = torch.sigmoid(o) * torch.tanh(self.cell_norm(c))
        return self.actor(h), h, c


class DreamerCell(nn.Module):
    """danijar/dreamerv3's recurrent cell, one block: a GRU whose gates are normalised together, update gate biased by -1."""

    def __init__(self, into=40, hidden=256):
        super().__init__()
        self.into, self.gates, self.norm, self.actor = nn.Linear(into, 128), nn.Linear(128 + hidden, 3 * hidden), nn.LayerNorm(3 * hidden), mlp(hidden, 128, 12, activation=nn.SiLU)

    def forward(self, obs, deter_in):
        reset, candidate, update = self.norm(self.gates(torch.cat((nn.functional.silu(self.into(obs)), deter_in), dim=-1))).chunk(3, dim=-1)
        update = torch.sigmoid(update - 1)
        deter = update * torch.tanh(torch.sigmoid(reset) * candidate) + (1 - update) * deter_in
        return torch.tanh(self.actor(deter)), deter


class DepthParkour(nn.Module):
    """chengxuxin/extreme-parkour, rsl_rl/modules/depth_backbone.py (DepthOnlyFCBackbone58x87, RecurrentDepthBackbone): a depth image of 58 x 87 and
    proprioception through a GRU of 512 to a latent of 32 and a yaw of 2, and an actor on those."""

    def __init__(self):
        super().__init__()
        self.image = nn.Sequential(nn.Conv2d(1, 32, 5), nn.MaxPool2d(2, 2), nn.ELU(), nn.Conv2d(32, 64, 3), nn.ELU(), nn.Flatten(), nn.Linear(64 * 25 * 39, 128),
                                   nn.ELU(), nn.Linear(128, 32), nn.ELU())
        self.both, self.rnn, self.output, self.actor = mlp(32 + 53, 128, 32), nn.GRU(32, 512, batch_first=True), nn.Sequential(nn.Linear(512, 34), nn.Tanh()), mlp(53 + 34, 512, 256, 128, 12)

    def forward(self, obs, depth, h_in):
        latent, h = self.rnn(self.both(torch.cat((self.image(depth.unsqueeze(1)), obs), dim=-1)).unsqueeze(1), h_in)
        return self.actor(torch.cat((obs, self.output(latent.squeeze(1))), dim=-1)), h
