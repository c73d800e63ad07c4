#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""The networks of `./dev bench inference`, with seeded weights, each as ONNX and as TorchScript: FOLDER/NAME.onnx, FOLDER/NAME.pt.
They are sized as published ones are; what they say means nothing. FOLDER/limit has ONNX networks of growing products of matrices, which show where
the built-in engine stops being the quicker one. Usage: inference_networks.py FOLDER
"""
import pathlib
import sys
import warnings

import torch
from torch import nn
from torch.nn import functional as F


class Perceptron(nn.Module):
    """A walking or reaching actor."""

    def __init__(self):
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(48, 512), nn.ELU(), nn.Linear(512, 256), nn.ELU(), nn.Linear(256, 128), nn.ELU(), nn.Linear(128, 12))

    def forward(self, obs):
        return self.layers(obs)


class Recurrent(nn.Module):
    def __init__(self):
        super().__init__()
        self.memory, self.head = nn.LSTM(48, 256), nn.Linear(256, 12)

    def forward(self, obs, h_in, c_in):
        y, (h_out, c_out) = self.memory(obs.unsqueeze(0), (h_in, c_in))
        return self.head(y.squeeze(0)), h_out, c_out


class Attention(nn.Module):
    def __init__(self, d, heads):
        super().__init__()
        self.d, self.heads = d, heads
        self.q, self.k, self.v, self.out = (nn.Linear(d, d) for _ in range(4))

    def split(self, y):
        return y.view(1, y.shape[1], self.heads, self.d // self.heads).transpose(1, 2)

    def forward(self, x, memory):
        q, k, v = self.split(self.q(x)), self.split(self.k(memory)), self.split(self.v(memory))
        weights = torch.softmax(q @ k.transpose(-2, -1) / (self.d // self.heads) ** 0.5, -1)
        return self.out((weights @ v).transpose(1, 2).reshape(1, x.shape[1], self.d))


class Layer(nn.Module):
    """Pre-norm; `crosses`: a decoder's layer, which reads the encoder too."""

    def __init__(self, d, heads, wide, crosses=False):
        super().__init__()
        self.norm1, self.norm2, self.attention = nn.LayerNorm(d), nn.LayerNorm(d), Attention(d, heads)
        self.up, self.down = nn.Linear(d, wide), nn.Linear(wide, d)
        self.cross = Attention(d, heads) if crosses else None
        self.norm3 = nn.LayerNorm(d) if crosses else None

    def forward(self, x, memory):
        y = self.norm1(x)
        x = x + self.attention(y, y)
        if self.cross is not None:
            x = x + self.cross(self.norm3(x), memory)
        return x + self.down(F.relu(self.up(self.norm2(x))))


class ChunkTransformer(nn.Module):
    """32 tokens of 256, four layers, 32 steps of 12 out."""

    def __init__(self):
        super().__init__()
        self.into, self.place = nn.Linear(48, 256), nn.Parameter(torch.randn(1, 32, 256) * 0.02)
        self.layers = nn.ModuleList(Layer(256, 8, 1024) for _ in range(4))
        self.head = nn.Linear(256, 12)

    def forward(self, obs):
        x = self.into(obs).unsqueeze(1) + self.place
        for layer in self.layers:
            x = layer(x, x)
        return self.head(x)


class Block(nn.Module):
    def __init__(self, into, out, stride):
        super().__init__()
        self.conv1, self.norm1 = nn.Conv2d(into, out, 3, stride, 1, bias=False), nn.BatchNorm2d(out)
        self.conv2, self.norm2 = nn.Conv2d(out, out, 3, 1, 1, bias=False), nn.BatchNorm2d(out)
        self.short = nn.Sequential(nn.Conv2d(into, out, 1, stride, bias=False), nn.BatchNorm2d(out)) if stride != 1 else nn.Identity()

    def forward(self, x):
        return F.relu(self.norm2(self.conv2(F.relu(self.norm1(self.conv1(x))))) + self.short(x))


class ActSized(nn.Module):
    """ResNet18 on a 224 x 224 image and a transformer of 512: encoder 4, decoder 1, chunk 100 of 14."""

    def __init__(self):
        super().__init__()
        self.stem = nn.Sequential(nn.Conv2d(3, 64, 7, 2, 3, bias=False), nn.BatchNorm2d(64), nn.ReLU(), nn.MaxPool2d(3, 2, 1))
        sizes = [(64, 64, 1), (64, 64, 1), (64, 128, 2), (128, 128, 1), (128, 256, 2), (256, 256, 1), (256, 512, 2), (512, 512, 1)]
        self.body = nn.Sequential(*(Block(*size) for size in sizes))
        self.state, self.patch = nn.Linear(14, 512), nn.Linear(512, 512)
        self.place, self.query = nn.Parameter(torch.randn(1, 50, 512) * 0.02), nn.Parameter(torch.randn(1, 100, 512) * 0.02)
        self.encoder = nn.ModuleList(Layer(512, 8, 3200) for _ in range(4))
        self.decoder, self.head = Layer(512, 8, 3200, crosses=True), nn.Linear(512, 14)

    def forward(self, obs, image):
        patches = self.body(self.stem(image)).flatten(2).transpose(1, 2)
        memory = torch.cat([self.state(obs).unsqueeze(1), self.patch(patches)], 1) + self.place
        for layer in self.encoder:
            memory = layer(memory, memory)
        return self.head(self.decoder(self.query, memory))


class Tokens(nn.Module):
    """The same layers for every one of some tokens."""

    def __init__(self, tokens):
        super().__init__()
        self.tokens, self.layers, self.head = tokens, nn.Sequential(nn.Linear(64, 256), nn.GELU(), nn.Linear(256, 64)), nn.Linear(64, 4)

    def forward(self, obs):
        return self.head(self.layers(obs.view(1, self.tokens, 64)))


class Attending(Tokens):
    def __init__(self, tokens):
        super().__init__(tokens)
        self.layers = Layer(64, 4, 256)

    def forward(self, obs):
        x = obs.view(1, self.tokens, 64)
        return self.head(self.layers(x, x))


class Looking(nn.Module):
    """A small image, or a scan of heights, in front of an actor."""

    def __init__(self, side):
        super().__init__()
        self.side = side
        self.cnn = nn.Sequential(nn.Conv2d(1, 16, 3, 2, 1), nn.ELU(), nn.Conv2d(16, 32, 3, 2, 1), nn.ELU(), nn.MaxPool2d(2), nn.Flatten())
        self.actor = nn.Sequential(nn.Linear(32 * (side // 8) ** 2, 128), nn.ELU(), nn.Linear(128, 12))

    def forward(self, obs):
        return self.actor(self.cnn(obs.view(1, 1, self.side, self.side)))


LIMIT = [(f"{name}-{size}", network, size, width(size)) for name, network, sizes, width in (
    ("tokens", Tokens, (2, 4, 8, 16, 32, 64), lambda tokens: tokens * 64), ("attention", Attending, (2, 4, 8, 16, 32, 64), lambda tokens: tokens * 64),
    ("image", Looking, (8, 16, 24, 32, 48, 64, 96), lambda side: side * side)) for size in sizes]
STATE = torch.zeros(1, 1, 256)
NETWORKS = (("mlp", Perceptron, {"obs": torch.zeros(1, 48)}, ("actions",)),
            ("lstm", Recurrent, {"obs": torch.zeros(1, 48), "h_in": STATE, "c_in": STATE}, ("actions", "h_out", "c_out")),
            ("transformer", ChunkTransformer, {"obs": torch.zeros(1, 48)}, ("actions",)),
            ("act", ActSized, {"obs": torch.zeros(1, 14), "image": torch.zeros(1, 3, 224, 224)}, ("actions",)))


def main(folder):
    warnings.filterwarnings("ignore")
    folder.mkdir(parents=True, exist_ok=True)
    for name, network, inputs, outputs in NETWORKS:
        torch.manual_seed(1)
        module = network().eval()
        torch.onnx.export(module, tuple(inputs.values()), folder / f"{name}.onnx", input_names=list(inputs), output_names=list(outputs), opset_version=17)
        torch.jit.script(module).save(str(folder / f"{name}.pt"))
    (folder / "limit").mkdir(exist_ok=True)
    for name, network, size, width in LIMIT:
        torch.manual_seed(1)
        torch.onnx.export(network(size).eval(), (torch.zeros(1, width),), folder / f"limit/{name}.onnx", input_names=["obs"], output_names=["actions"], opset_version=17)


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]))
