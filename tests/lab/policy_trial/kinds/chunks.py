# SPDX-License-Identifier: Apache-2.0
"""Policies of images and of chunks of actions: ACT, diffusion, flow matching, causal transformers, action experts."""
import math

import torch
from torch import nn
from torch.nn import functional as F


class Attention(nn.Module):
    """Scaled dot-product attention as exporters write it for opsets without one: MatMul, Div, Add of a mask, Softmax, MatMul."""

    def __init__(self, d, heads, context=None, bias=True):
        super().__init__()
        self.heads, self.width = heads, d // heads
        self.q, self.k, self.v, self.out = nn.Linear(d, d, bias), nn.Linear(context or d, d, bias), nn.Linear(context or d, d, bias), nn.Linear(d, d, bias)

    def split(self, y):
        return y.view(1, y.shape[1], self.heads, self.width).transpose(1, 2)

    def forward(self, x, memory, mask=None, turn=None):
        q, k, v = self.split(self.q(x)), self.split(self.k(memory)), self.split(self.v(memory))
        if turn is not None:
            q, k = turn(q), turn(k)
        scores = q @ k.transpose(-2, -1) / math.sqrt(self.width)
        if mask is not None:
            scores = scores.masked_fill(mask == 0, float("-inf"))
        return self.out((torch.softmax(scores, -1) @ v).transpose(1, 2).reshape(1, x.shape[1], -1))


class Layer(nn.Module):
    def __init__(self, d, heads, wide, crosses=False, activation=F.relu):
        super().__init__()
        self.norm1, self.norm2, self.attention, self.activation = nn.LayerNorm(d), nn.LayerNorm(d), Attention(d, heads), activation
        self.up, self.down = nn.Linear(d, wide), nn.Linear(wide, d)
        self.cross, self.norm3 = (Attention(d, heads), nn.LayerNorm(d)) if crosses else (None, None)

    def forward(self, x, memory=None, mask=None):
        y = self.norm1(x)
        x = x + self.attention(y, y, mask)
        if self.cross is not None:
            x = x + self.cross(self.norm3(x), memory)
        return x + self.down(self.activation(self.up(self.norm2(x))))


class ChunkTransformer(nn.Module):
    """A small decoder of chunks: one token of the observation, 16 of steps, GELU."""

    def __init__(self, d=128, steps=16, layers=2, out=12):
        super().__init__()
        self.into, self.place = nn.Linear(48, d), nn.Parameter(torch.randn(1, steps, d) * 0.1)
        self.layers, self.norm, self.head = nn.ModuleList(Layer(d, 4, 4 * d, activation=F.gelu) for _ in range(layers)), nn.LayerNorm(d), nn.Linear(d, out)

    def forward(self, obs):
        x = self.into(obs).unsqueeze(1) + self.place
        for layer in self.layers:
            x = layer(x)
        return self.head(self.norm(x))


class CausalGpt(nn.Module):
    """notmahi/miniBET and jayLEE0301/vq_bet_official on karpathy/minGPT: a window of observations, masked with -inf, a chunk of the last token's."""

    def __init__(self, d=120, steps=10, layers=3):
        super().__init__()
        self.into, self.place, self.head = nn.Linear(27, d), nn.Parameter(torch.randn(1, steps, d) * 0.1), nn.Linear(d, 5 * 9, bias=False)
        self.layers, self.norm = nn.ModuleList(Layer(d, 6, 4 * d, activation=F.gelu) for _ in range(layers)), nn.LayerNorm(d)
        self.register_buffer("mask", torch.tril(torch.ones(1, 1, steps, steps)))

    def forward(self, obs):
        x = self.into(obs) + self.place
        for layer in self.layers:
            x = layer(x, mask=self.mask)
        return self.head(self.norm(x))[:, -1].view(1, 5, 9)


class Block(nn.Module):
    def __init__(self, into, out, stride, norm=nn.BatchNorm2d):
        super().__init__()
        self.conv1, self.norm1 = nn.Conv2d(into, out, 3, stride, 1, bias=False), norm(out)
        self.conv2, self.norm2 = nn.Conv2d(out, out, 3, 1, 1, bias=False), norm(out)
        self.short = nn.Sequential(nn.Conv2d(into, out, 1, stride, bias=False), norm(out)) if stride != 1 or into != out else nn.Identity()

    def forward(self, x):
        return F.relu(self.norm2(self.conv2(F.relu(self.norm1(self.conv1(x))))) + self.short(x))


def resnet18(norm=nn.BatchNorm2d):
    sizes = [(64, 64, 1), (64, 64, 1), (64, 128, 2), (128, 128, 1), (128, 256, 2), (256, 256, 1), (256, 512, 2), (512, 512, 1)]
    return nn.Sequential(nn.Conv2d(3, 64, 7, 2, 3, bias=False), norm(64), nn.ReLU(), nn.MaxPool2d(3, 2, 1), *(Block(*size, norm) for size in sizes))


class Act(nn.Module):
    """tonyzhaozh/act, as huggingface/lerobot, policies/act/configuration_act.py has it: ResNet18, d 512, 8 heads, 3200 wide, encoder 4, decoder 1, chunk
    100; inference sets the latent to zero."""

    def __init__(self, side=224):
        super().__init__()
        tokens = (side // 32) ** 2
        self.body, self.patch, self.state, self.latent = resnet18(), nn.Conv2d(512, 512, 1), nn.Linear(14, 512), nn.Linear(32, 512)
        self.place, self.query = nn.Parameter(torch.randn(1, tokens + 2, 512) * 0.02), nn.Parameter(torch.randn(1, 100, 512) * 0.02)
        self.encoder, self.decoder, self.head = nn.ModuleList(Layer(512, 8, 3200) for _ in range(4)), Layer(512, 8, 3200, crosses=True), nn.Linear(512, 14)

    def forward(self, state, image):
        pixels = (image - 0.45) / 0.225
        patches = self.patch(self.body(pixels)).flatten(2).transpose(1, 2)
        memory = torch.cat([self.latent(torch.zeros(1, 32)).unsqueeze(1), self.state(state).unsqueeze(1), patches], 1) + self.place
        for layer in self.encoder:
            memory = layer(memory)
        return self.head(self.decoder(self.query, memory))


class SpatialSoftmax(nn.Module):
    """huggingface/lerobot, policies/diffusion/modeling_diffusion.py (DiffusionRgbEncoder): keypoints of feature maps, each its expected place; images
    are resized first (Resize)."""

    def __init__(self, side=48):
        super().__init__()
        self.body = nn.Sequential(nn.Conv2d(3, 32, 5, 2, 2), nn.GroupNorm(8, 32), nn.ReLU(), nn.Conv2d(32, 32, 3, 2, 1), nn.ReLU())
        grid = torch.linspace(-1, 1, side // 4)
        self.register_buffer("grid", torch.stack((grid.repeat(side // 4), grid.repeat_interleave(side // 4)), dim=1))
        self.side, self.out = side, nn.Sequential(nn.Linear(64 + 7, 128), nn.ReLU(), nn.Linear(128, 7))

    def forward(self, state, image):
        small = F.interpolate(image, size=(self.side, self.side), mode="bilinear", align_corners=False)
        places = torch.softmax(self.body(small).reshape(32, -1), dim=-1) @ self.grid
        return self.out(torch.cat((places.reshape(1, -1), state), dim=-1))


def time_features(t, width):
    half = width // 2
    angles = t.unsqueeze(-1) * torch.exp(torch.arange(half, dtype=torch.float32) * (-math.log(10000.0) / (half - 1)))
    return torch.cat((angles.sin(), angles.cos()), dim=-1)


class ConvBlock(nn.Module):
    def __init__(self, into, out, condition):
        super().__init__()
        self.first = nn.Sequential(nn.Conv1d(into, out, 5, padding=2), nn.GroupNorm(8, out), nn.Mish())
        self.second = nn.Sequential(nn.Conv1d(out, out, 5, padding=2), nn.GroupNorm(8, out), nn.Mish())
        self.film, self.short = nn.Linear(condition, 2 * out), nn.Conv1d(into, out, 1) if into != out else nn.Identity()

    def forward(self, x, condition):
        scale, bias = self.film(F.mish(condition)).unsqueeze(-1).chunk(2, dim=1)
        return self.second(self.first(x) * scale + bias) + self.short(x)


class DiffusionUnet(nn.Module):
    """real-stanford/diffusion_policy, model/diffusion/conditional_unet1d.py: one denoising step of a chunk of 16, GroupNorm, Mish, FiLM, ConvTranspose;
    the down dimensions are a quarter of the published 256, 512, 1024."""

    def __init__(self, dims=(64, 128, 256), actions=7, condition=40):
        super().__init__()
        width = 64 + condition
        self.time = nn.Sequential(nn.Linear(64, 256), nn.Mish(), nn.Linear(256, 64))
        pairs = list(zip((actions, *dims), dims))
        self.down = nn.ModuleList(nn.ModuleList((ConvBlock(a, b, width), ConvBlock(b, b, width), nn.Conv1d(b, b, 3, 2, 1))) for a, b in pairs)
        self.middle = ConvBlock(dims[-1], dims[-1], width)
        self.up = nn.ModuleList(nn.ModuleList((nn.ConvTranspose1d(b, b, 4, 2, 1), ConvBlock(2 * b, a if a != actions else dims[0], width))) for a, b in reversed(pairs))
        self.last = nn.Sequential(nn.Conv1d(dims[0], dims[0], 5, padding=2), nn.GroupNorm(8, dims[0]), nn.Mish(), nn.Conv1d(dims[0], actions, 1))

    def forward(self, sample, timestep, global_cond):
        condition, x, kept = torch.cat((self.time(time_features(timestep, 64)), global_cond), dim=-1), sample.transpose(1, 2), []
        for first, second, smaller in self.down:
            x = second(first(x, condition), condition)
            kept.append(x)
            x = smaller(x)
        x = self.middle(x, condition)
        for larger, block in self.up:
            x = block(torch.cat((larger(x), kept.pop()), dim=1), condition)
        return self.last(x).transpose(1, 2)


class FlowVelocity(nn.Module):
    """The velocity of a flow-matching policy as real-time chunking asks it, Physical-Intelligence/real-time-chunking-kinetix: x_t, t, obs -> velocity, of a
    chunk of 8 (an MLP over steps and over actions)."""

    def __init__(self, steps=8, actions=6, d=256):
        super().__init__()
        self.into, self.condition, self.time, self.out = nn.Linear(actions, d), nn.Linear(30, d), nn.Linear(64, d), nn.Linear(d, actions)
        self.over_steps = nn.ModuleList(nn.Sequential(nn.Linear(steps, 64), nn.GELU(), nn.Linear(64, steps)) for _ in range(2))
        self.over_actions = nn.ModuleList(nn.Sequential(nn.LayerNorm(d), nn.Linear(d, 2 * d), nn.GELU(), nn.Linear(2 * d, d)) for _ in range(2))

    def forward(self, obs, x_t, t):
        x = self.into(x_t) + F.silu(self.condition(obs) + self.time(time_features(t, 64))).unsqueeze(1)
        for steps, actions in zip(self.over_steps, self.over_actions):
            x = x + steps(x.transpose(1, 2)).transpose(1, 2)
            x = x + actions(x)
        return self.out(x)


class RmsNorm(nn.Module):
    def __init__(self, d):
        super().__init__()
        self.weight = nn.Parameter(torch.ones(d))

    def forward(self, x):
        return x * torch.rsqrt(x.pow(2).mean(-1, keepdim=True) + 1e-5) * self.weight


class ExpertLayer(nn.Module):
    def __init__(self, d, heads, wide, context=None):
        super().__init__()
        self.norm1, self.norm2, self.attention = RmsNorm(d), RmsNorm(d), Attention(d, heads, context, bias=False)
        self.gate, self.up, self.down = (nn.Linear(a, b, False) for a, b in ((d, wide), (d, wide), (wide, d)))

    def forward(self, x, memory, turn):
        y = self.norm1(x)
        x = x + (self.attention(y, y, turn=turn) if memory is None else self.attention(y, memory))
        y = self.norm2(x)
        return x + self.down(F.silu(self.gate(y)) * self.up(y))


class ActionExpert(nn.Module):
    """huggingface/lerobot, policies/smolvla: one denoising step of the action expert on what the language model made of images and prompt: RMSNorm,
    SiLU-gated layers, rotary positions, self- and cross-attention in turns, chunk 50. Half as deep and wide as published (720 wide, 16 layers)."""

    def __init__(self, d=360, context=480, layers=8, steps=50, actions=32):
        super().__init__()
        self.action_in, self.action_out, self.d, self.steps = nn.Linear(actions, d), nn.Linear(d, actions), d, steps
        self.time_in, self.time_out = nn.Linear(2 * d, d), nn.Linear(d, d)
        self.layers, self.norm = nn.ModuleList(ExpertLayer(d, 6, 960, context if i % 2 else None) for i in range(layers)), RmsNorm(d)
        angles = torch.arange(steps).unsqueeze(1) * 10000.0 ** (-torch.arange(0, 60, 2) / 60.0)
        self.register_buffer("cosine", angles.cos())
        self.register_buffer("sine", angles.sin())

    def turn(self, x):
        a, b = x.chunk(2, dim=-1)
        return torch.cat((a * self.cosine - b * self.sine, b * self.cosine + a * self.sine), dim=-1)

    def forward(self, prefix, x_t, timestep):
        x = self.action_in(x_t)
        time = time_features(timestep, self.d).unsqueeze(1).expand(1, self.steps, self.d)
        x = self.time_out(F.silu(self.time_in(torch.cat((x, time), dim=-1))))
        for i, layer in enumerate(self.layers):
            x = layer(x, prefix if i % 2 else None, self.turn)
        return self.action_out(self.norm(x))


class DiffusionTransformer(nn.Module):
    """NVIDIA/Isaac-GR00T's action head in small: adaptive layer norm by the time step (without weights of its own, so written out), cross-attention to features."""

    def __init__(self, d=192, steps=16, layers=3, context=256):
        super().__init__()
        self.into, self.out, self.place, self.time = nn.Linear(24, d), nn.Linear(d, 24), nn.Parameter(torch.randn(1, steps, d) * 0.1), nn.Linear(64, d)
        self.shift = nn.ModuleList(nn.Linear(d, 2 * d) for _ in range(layers))
        self.norms = nn.ModuleList(nn.LayerNorm(d, elementwise_affine=False) for _ in range(layers))
        self.attentions = nn.ModuleList(Attention(d, 4, context) for _ in range(layers))
        self.feeds = nn.ModuleList(nn.Sequential(nn.LayerNorm(d), nn.Linear(d, 4 * d), nn.GELU(), nn.Linear(4 * d, d)) for _ in range(layers))

    def forward(self, features, noisy_actions, timestep):
        x, time = self.into(noisy_actions) + self.place, F.silu(self.time(time_features(timestep, 64)))
        for shift, norm, attention, feed in zip(self.shift, self.norms, self.attentions, self.feeds):
            scale, bias = shift(time).unsqueeze(1).chunk(2, dim=-1)
            x = x + attention(norm(x) * (1 + scale) + bias, features)
            x = x + feed(x)
        return self.out(x)


class NatureCnn(nn.Module):
    """DLR-RM/stable-baselines3, MultiInputPolicy: NatureCNN on an image that is divided by 255, flattened with the other inputs (issue 1349)."""

    def __init__(self):
        super().__init__()
        self.cnn = nn.Sequential(nn.Conv2d(1, 32, 8, 4), nn.ReLU(), nn.Conv2d(32, 64, 4, 2), nn.ReLU(), nn.Conv2d(64, 64, 3, 1), nn.ReLU(), nn.Flatten())
        self.linear, self.policy, self.action_net = nn.Sequential(nn.Linear(64 * 4 * 4, 256), nn.ReLU()), nn.Sequential(nn.Linear(256 + 9 + 3, 64), nn.Tanh(), nn.Linear(64, 64), nn.Tanh()), nn.Linear(64, 6)

    def forward(self, image, joints, goal):
        return self.action_net(self.policy(torch.cat((self.linear(self.cnn(image / 255.0)), joints, goal), dim=1)))
