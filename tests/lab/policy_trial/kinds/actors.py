# SPDX-License-Identifier: Apache-2.0
"""Actors without memory: networks as the projects named build them, and their exporters write them."""
import torch
from torch import nn
from torch.nn import functional as F

from export import mlp


class RslRl(nn.Module):
    """leggedrobotics/rsl_rl: ELU 512-256-128; isaac-sim/IsaacLab, isaaclab_rl/rsl_rl/exporter.py: obs -> actions, opset 11."""

    def __init__(self, into=48, out=12):
        super().__init__()
        self.actor = mlp(into, 512, 256, 128, out)

    def forward(self, x):
        return self.actor(x)


class Normalised(nn.Module):
    """rsl_rl's EmpiricalNormalization in front, as the same exporter copies it."""

    def __init__(self, into=48, out=12, hidden=(512, 256, 128)):
        super().__init__()
        self.actor = mlp(into, *hidden, out)
        self.register_buffer("mean", torch.zeros(1, into))
        self.register_buffer("std", torch.ones(1, into))

    def forward(self, x):
        return self.actor((x - self.mean) / (self.std + 0.01))


class RlGames(nn.Module):
    """Denys88/rl_games, notebooks/train_and_export_onnx_example_continuous.ipynb: running mean and variance inside, clipped to 5; mu, log_std, value."""

    def __init__(self):
        super().__init__()
        self.body, self.mu, self.value = mlp(60, 256, 128, 64), nn.Linear(64, 8), nn.Linear(64, 1)
        self.register_buffer("running_mean", torch.zeros(60))
        self.register_buffer("running_var", torch.ones(60))
        self.log_std = nn.Parameter(torch.zeros(8))

    def forward(self, obs):
        y = F.elu(self.body(torch.clamp((obs - self.running_mean) / torch.sqrt(self.running_var + 1e-5), -5.0, 5.0)))
        mu = self.mu(y)
        return mu, mu * 0 + self.log_std, self.value(y)


class Skrl(nn.Module):
    """Toni-SM/skrl: RunningStandardScaler (clip 5) and a Gaussian policy over shared layers."""

    def __init__(self):
        super().__init__()
        self.net, self.policy = nn.Sequential(nn.Linear(36, 256), nn.ELU(), nn.Linear(256, 128), nn.ELU(), nn.Linear(128, 64), nn.ELU()), nn.Linear(64, 8)
        self.register_buffer("running_mean", torch.zeros(36))
        self.register_buffer("running_var", torch.ones(36))

    def forward(self, states):
        scaled = torch.clamp((states - self.running_mean) / (torch.sqrt(self.running_var) + 1e-8), -5.0, 5.0)
        return torch.tanh(self.policy(self.net(scaled)))


class StableBaselines(nn.Module):
    """DLR-RM/stable-baselines3, docs/guide/export.rst: input -> actions, values, log_prob; tanh 64-64, opset 17."""

    def __init__(self):
        super().__init__()
        self.policy, self.critic = mlp(27, 64, 64, activation=nn.Tanh), mlp(27, 64, 64, activation=nn.Tanh)
        self.action_net, self.value_net, self.log_std = nn.Linear(64, 8), nn.Linear(64, 1), nn.Parameter(torch.randn(8) * 0.1)

    def forward(self, observation):
        flat = torch.flatten(observation, 1)
        mean = self.action_net(torch.tanh(self.policy(flat)))
        deviation = torch.ones_like(mean) * self.log_std.exp()
        log_prob = -((mean - mean) ** 2) / (2 * deviation ** 2) - deviation.log() - 0.9189385332
        return mean, self.value_net(torch.tanh(self.critic(flat))), log_prob.sum(1)


class Playground(nn.Module):
    """google-deepmind/mujoco_playground, experimental/x02_walking/convert_to_onnx.py: brax PPO through tf2onnx, opset 11: MatMul and Add, SiLU,
    Split into location and scale, tanh; obs -> continuous_actions."""

    def __init__(self):
        super().__init__()
        widths = (103, 512, 256, 128, 58)
        self.kernels = nn.ParameterList(nn.Parameter(torch.randn(a, b) / a ** 0.5) for a, b in zip(widths, widths[1:]))
        self.biases = nn.ParameterList(nn.Parameter(torch.randn(b) * 0.1) for b in widths[1:])
        self.register_buffer("mean", torch.zeros(103))
        self.register_buffer("std", torch.ones(103))

    def forward(self, obs):
        y = (obs - self.mean) / self.std
        for i, (kernel, bias) in enumerate(zip(self.kernels, self.biases)):
            y = y @ kernel + bias
            if i + 1 < len(self.kernels):
                y = y * torch.sigmoid(y)
        location, _ = torch.split(y, 29, dim=-1)
        return torch.tanh(location)


class HimLoco(nn.Module):
    """OpenRobotLab/HIMLoco, legged_gym/utils/helpers.py (PolicyExporterHIM) as deployed in fan-ziqi/rl_sar: six observations of 45 in one; of the
    estimator's 19 numbers, 3 are velocity and 16 a unit vector (ReduceL2)."""

    def __init__(self):
        super().__init__()
        self.estimator, self.actor = mlp(270, 128, 64, 19), mlp(64, 512, 256, 128, 12)

    def forward(self, obs_history):
        parts = self.estimator(obs_history)
        latent = F.normalize(parts[:, 3:], p=2.0, dim=-1)
        return self.actor(torch.cat((obs_history[:, :45], parts[:, :3], latent), dim=1))


class WalkTheseWays(nn.Module):
    """Improbable-AI/walk-these-ways, go1_gym_learn/ppo_cse/actor_critic.py (act_student): 30 observations of 70 through an adaptation module into the
    body. Published are the two by themselves, body_latest.jit and adaptation_module_latest.jit."""

    def __init__(self):
        super().__init__()
        self.adaptation_module, self.actor_body = mlp(2100, 256, 128, 2), mlp(2102, 512, 256, 128, 12)

    def forward(self, obs_history):
        return self.actor_body(torch.cat((obs_history, self.adaptation_module(obs_history)), dim=-1))


class HistoryEncoder(nn.Module):
    """chengxuxin/extreme-parkour, rsl_rl/modules/actor_critic.py (StateHistoryEncoder, after RMA): ten observations, a linear layer each, Conv1d over
    time."""

    def __init__(self, width=53, steps=10, out=20):
        super().__init__()
        self.width, self.steps = width, steps
        self.encoder = nn.Sequential(nn.Linear(width, 30), nn.ELU())
        self.over_time = nn.Sequential(nn.Conv1d(30, 20, 4, 2), nn.ELU(), nn.Conv1d(20, 10, 2, 1), nn.ELU(), nn.Flatten())
        self.output = nn.Sequential(nn.Linear(30, out), nn.ELU())

    def forward(self, history):
        each = self.encoder(history.reshape(self.steps, self.width))
        return self.output(self.over_time(each.reshape(1, self.steps, -1).permute(0, 2, 1)))


class Rma(nn.Module):
    """The student of a teacher: proprioception and its history in one observation."""

    def __init__(self):
        super().__init__()
        self.history, self.actor = HistoryEncoder(), mlp(53 + 20, 512, 256, 128, 12)

    def forward(self, obs):
        return self.actor(torch.cat((obs[:, :53], self.history(obs[:, 53:])), dim=1))


class ParkourBase(nn.Module):
    """chengxuxin/extreme-parkour, legged_gym/scripts/save_jit.py (HardwareVisionNN): obs, depth_latent -> actions; the estimator's answer is written
    into the observation (ScatterND)."""

    def __init__(self):
        super().__init__()
        self.estimator, self.history, self.actor = mlp(53, 128, 64, 9), HistoryEncoder(), mlp(53 + 32 + 9 + 20, 512, 256, 128, 12)

    def forward(self, obs, depth_latent):
        obs = obs.clone()
        obs[:, 185:194] = self.estimator(obs[:, :53])
        return self.actor(torch.cat((obs[:, :53], depth_latent, obs[:, 185:194], self.history(obs[:, -530:])), dim=1))


class HeightScan(nn.Module):
    """isaac-sim/IsaacLab, velocity tasks on rough terrain: a scan of 11 x 17 heights behind 48 numbers, clipped."""

    def __init__(self):
        super().__init__()
        self.actor = mlp(48 + 187, 512, 256, 128, 12)

    def forward(self, obs):
        return self.actor(torch.cat((obs[:, :48], torch.clamp(obs[:, 48:], -1.0, 1.0)), dim=1))


class HeightScanCnn(nn.Module):
    """An actor with a convolution over the scan, as rsl_rl's CNN models take a group of observations of two dimensions: two inputs."""

    def __init__(self):
        super().__init__()
        self.cnn = nn.Sequential(nn.Conv2d(1, 16, 3, 2, 1), nn.ELU(), nn.Conv2d(16, 32, 3, 2, 1), nn.ELU(), nn.Flatten())
        self.actor = mlp(48 + 32 * 3 * 5, 256, 128, 12)

    def forward(self, policy, height_scan):
        return self.actor(torch.cat((policy, self.cnn(height_scan)), dim=1))


class MotionTracker(nn.Module):
    """HybridRobotics/whole_body_tracking, utils/exporter.py: obs, time_step -> actions, and the motion's frame at that step: joint_pos, joint_vel,
    body_pos_w, body_quat_w, body_lin_vel_w, body_ang_vel_w."""

    def __init__(self, frames=200, joints=29, bodies=14):
        super().__init__()
        self.actor, self.last = mlp(160, 512, 256, 128, joints), frames - 1
        for name, width in (("joint_pos", (joints,)), ("joint_vel", (joints,)), ("body_pos", (bodies, 3)), ("body_quat", (bodies, 4)),
                            ("body_lin_vel", (bodies, 3)), ("body_ang_vel", (bodies, 3))):
            self.register_buffer(name, torch.randn(frames, *width))

    def forward(self, obs, time_step):
        step = torch.clamp(time_step.long().squeeze(-1), max=self.last)
        return (self.actor(obs), self.joint_pos[step], self.joint_vel[step], self.body_pos[step], self.body_quat[step], self.body_lin_vel[step],
                self.body_ang_vel[step])


class DreamWaq(nn.Module):
    """The context estimator of DreamWaQ (arXiv 2301.10602) as reimplementations export it: history of five, mean of the latent, velocity."""

    def __init__(self):
        super().__init__()
        self.encoder, self.mean, self.velocity, self.actor = mlp(225, 128, 64), nn.Linear(64, 16), nn.Linear(64, 3), mlp(45 + 19, 512, 256, 128, 12)

    def forward(self, obs, obs_history):
        y = F.elu(self.encoder(obs_history))
        return self.actor(torch.cat((obs, self.velocity(y), self.mean(y)), dim=-1))


class Mixture(nn.Module):
    """ami-iit/amp-rsl-rl, ActorMoE: all experts, weighed by a softmax of a gate. `einsum`: the sum as torch.einsum writes it."""

    def __init__(self, einsum=False):
        super().__init__()
        self.experts, self.gate, self.einsum = nn.ModuleList(mlp(48, 256, 128, 12) for _ in range(4)), mlp(48, 64, 4), einsum

    def forward(self, obs):
        weights = torch.softmax(self.gate(obs), dim=-1)
        answers = torch.stack([expert(obs) for expert in self.experts], dim=1)
        if self.einsum:
            return torch.einsum("be,bea->ba", weights, answers)
        return (answers * weights.unsqueeze(-1)).sum(1)


class TdMpc(nn.Module):
    """nicklashansen/tdmpc2, common/layers.py: NormedLinear (LayerNorm, Mish) and SimNorm (softmax in groups of 8), then the policy's mean."""

    def __init__(self):
        super().__init__()
        self.encoder = nn.Sequential(nn.Linear(39, 256), nn.LayerNorm(256), nn.Mish(), nn.Linear(256, 512), nn.LayerNorm(512))
        self.pi = nn.Sequential(nn.Linear(512, 512), nn.LayerNorm(512), nn.Mish(), nn.Linear(512, 42))

    def forward(self, obs):
        z = torch.softmax(self.encoder(obs).view(1, -1, 8), dim=-1).view(1, 512)
        mean, _ = self.pi(z).chunk(2, dim=-1)
        return torch.tanh(mean)


class Geglu(nn.Module):
    """A residual actor with GELU, which exporters write as one operator from opset 20 on (here as Erf) and as Softplus at opset 21 alike."""

    def __init__(self, activation=nn.GELU):
        super().__init__()
        self.into, self.up, self.down, self.out, self.activation = nn.Linear(64, 128), nn.Linear(128, 256), nn.Linear(256, 128), nn.Linear(128, 12), activation()

    def forward(self, obs):
        x = self.into(obs)
        return self.out(x + self.down(self.activation(self.up(x))))


class Points(nn.Module):
    """YanjieZe/3D-Diffusion-Policy's encoder: a network per point, the largest over all of them (ReduceMax), beside the robot's state."""

    def __init__(self):
        super().__init__()
        self.each, self.state, self.actor = nn.Sequential(nn.Linear(3, 64), nn.LayerNorm(64), nn.ReLU(), nn.Linear(64, 64)), mlp(9, 64, 64), mlp(128, 128, 9)

    def forward(self, point_cloud, agent_pos):
        return self.actor(torch.cat((torch.max(self.each(point_cloud), 1)[0], self.state(agent_pos)), dim=-1))
