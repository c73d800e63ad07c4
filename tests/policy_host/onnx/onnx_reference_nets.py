# SPDX-License-Identifier: Apache-2.0
"""Writes random small networks with inputs and outputs, for the ONNX engine to agree with.

usage: onnx_reference_nets.py FOLDER
Each network becomes FOLDER/<name>-<opset>.onnx and .txt: the number of cases, then per case one line with all inputs and
one with the first output as PyTorch computes it. Exit status 77: PyTorch or onnx is not installed.
"""

import pathlib
import sys
import warnings

try:
    import onnx  # noqa: F401  (the exporter needs it)
    import torch
    from torch import nn
except ImportError as error:
    print(f"cannot make reference networks: {error}", file=sys.stderr)
    sys.exit(77)

CASES = 5


class Attention(nn.Module):
    """A pre-norm transformer block written with views, as policies with action chunks have it."""

    def __init__(self, width=24, heads=3):
        super().__init__()
        self.heads = heads
        self.norm1, self.norm2 = nn.LayerNorm(width), nn.LayerNorm(width)
        self.qkv, self.out = nn.Linear(width, 3 * width), nn.Linear(width, width)
        self.mlp = nn.Sequential(nn.Linear(width, 40), nn.GELU(), nn.Linear(40, width))

    def forward(self, x):
        batch, steps, width = x.shape
        q, k, v = (
            part.view(batch, steps, self.heads, width // self.heads).transpose(1, 2)
            for part in self.qkv(self.norm1(x)).chunk(3, dim=-1)
        )
        weight = torch.softmax(q @ k.transpose(-1, -2) * 0.35, dim=-1)
        x = x + self.out((weight @ v).transpose(1, 2).reshape(batch, steps, width))
        return x + self.mlp(self.norm2(x))


class Memory(nn.Module):
    """A recurrent policy whose state goes in and comes out, as locomotion policies export it."""

    def __init__(self, cell, **options):
        super().__init__()
        self.rnn = cell(10, 12, 2, **options)
        self.head = nn.Linear(12 * (2 if self.rnn.bidirectional else 1), 4)

    def forward(self, x, *state):
        state = (state[0] if len(state) == 1 else state) if state else None
        y, _ = self.rnn(x, state)
        return self.head(y[-1])


def networks():
    state = (2, 1, 12)
    yield "mlp_elu", nn.Sequential(nn.Linear(17, 33), nn.ELU(), nn.Linear(33, 20), nn.ELU(), nn.Linear(20, 6)), [(1, 17)]
    yield "mlp_mixed", nn.Sequential(
        nn.Linear(9, 21), nn.Tanh(), nn.Linear(21, 13), nn.SiLU(), nn.Linear(13, 8), nn.LeakyReLU(),
        nn.Linear(8, 5), nn.Sigmoid(), nn.Linear(5, 5), nn.Hardtanh(-0.2, 0.2), nn.Softmax(dim=-1)), [(1, 9)]
    yield "attention", Attention(), [(1, 7, 24)]
    yield "encoder", nn.TransformerEncoderLayer(16, 4, 32, dropout=0.0, batch_first=True), [(1, 5, 16)]
    yield "lstm", Memory(nn.LSTM), [(6, 1, 10)]
    yield "lstm_state", Memory(nn.LSTM), [(1, 1, 10), state, state]
    yield "lstm_both", Memory(nn.LSTM, bidirectional=True), [(6, 1, 10)]
    yield "gru", Memory(nn.GRU), [(6, 1, 10)]
    yield "gru_state", Memory(nn.GRU), [(1, 1, 10), state]


def write(folder, name, net, shapes, opset, open_batch):
    inputs = [f"x{i}" for i in range(len(shapes))]
    # The batch is the second dimension of everything recurrent and the first of the rest.
    axes = {x: {1 if "lstm" in name or "gru" in name else 0: "batch"} for x in inputs} if open_batch else None
    stem = folder / f"{name}-{opset}{'-batch' if open_batch else ''}"
    torch.onnx.export(net, tuple(torch.zeros(s) for s in shapes), f"{stem}.onnx", opset_version=opset,
                      input_names=inputs, output_names=["y"], dynamic_axes=axes)
    lines = [str(CASES)]
    for _ in range(CASES):
        values = [torch.randn(s) for s in shapes]
        with torch.no_grad():
            y = net(*values)
        for numbers in (torch.cat([v.flatten() for v in values]), y.flatten()):
            lines.append(" ".join(f"{number:.9g}" for number in numbers.tolist()))
    pathlib.Path(f"{stem}.txt").write_text("\n".join(lines) + "\n")


def main():
    folder = pathlib.Path(sys.argv[1])
    warnings.simplefilter("ignore")
    torch.manual_seed(1)
    torch.set_num_threads(1)
    for name, net, shapes in networks():
        net.eval()
        for opset in (11, 17):
            for open_batch in (False, True):
                write(folder, name, net, shapes, opset, open_batch)


main()
