# SPDX-License-Identifier: Apache-2.0
"""ACT (Zhao et al. 2023) as LeRobot runs it: the latent is zero, tokens [latent, state, environment, image features] go through a transformer encoder, and a
decoder says the whole chunk.
"""
import math
from typing import List

import numpy as np

from takt._refused import Refused
from takt.lerobot._checkpoint import Checkpoint
from takt.lerobot._graph import Array, Graph
from takt.lerobot._resnet import BACKBONES, ResNet

USED = ("n_obs_steps", "chunk_size", "n_action_steps", "vision_backbone", "replace_final_stride_with_dilation", "pre_norm", "dim_model", "n_heads",
        "dim_feedforward", "feedforward_activation", "n_encoder_layers", "n_decoder_layers", "latent_dim", "temporal_ensemble_coeff")
OF_TRAINING = ("pretrained_backbone_weights", "use_vae", "n_vae_encoder_layers", "dropout", "kl_weight", "optimizer_lr", "optimizer_weight_decay",
               "optimizer_lr_backbone")


def _image_places(width: int, height: int, columns: int) -> Array:
    """(height * columns, width): the sinusoidal places of a feature map, as DETR has them; rows first, then columns."""
    frequencies = np.power(10000.0, 2 * (np.arange(width // 2) // 2) / (width // 2))
    halves = []
    for extent, along in ((height, np.arange(1, height + 1)[:, None]), (columns, np.arange(1, columns + 1)[None, :])):
        angles = np.broadcast_to(along / (extent + 1e-6) * 2 * math.pi, (height, columns))[..., None] / frequencies
        halves.append(np.stack((np.sin(angles[..., 0::2]), np.cos(angles[..., 1::2])), axis=-1).reshape(height, columns, -1))
    places: Array = np.concatenate(halves, axis=-1).reshape(-1, width)
    return places


class _Transformer:
    def __init__(self, graph: Graph, checkpoint: Checkpoint) -> None:
        self._graph, self._weights = graph, checkpoint.weights
        self._width, self._heads = checkpoint.integer("dim_model", 4, 8192), checkpoint.integer("n_heads", 1, 256)
        self._wide = checkpoint.integer("dim_feedforward", 1, 65536)
        self._activation = checkpoint.choice("feedforward_activation", ("relu", "gelu"))
        self._norm_first = checkpoint.flag("pre_norm")
        if self._width % self._heads or self._width % 4:
            raise Refused(f"{checkpoint.folder}/config.json: dim_model {self._width} is no multiple of n_heads {self._heads} and of 4")

    def norm(self, x: str, name: str) -> str:
        weights = [self._graph.constant(self._weights.take(f"{name}.{part}", self._width), f"{name}.{part}") for part in ("weight", "bias")]
        return self._graph.op("LayerNormalization", x, *weights, epsilon=1e-5)

    def _attention(self, name: str, query: str, key: str, value: str) -> str:
        graph, d, per_head = self._graph, self._width, self._width // self._heads
        weight, bias = self._weights.take(f"{name}.in_proj_weight", 3 * d, d), self._weights.take(f"{name}.in_proj_bias", 3 * d)
        parts = []
        for index, (x, order) in enumerate(((query, [1, 0, 2]), (key, [1, 2, 0]), (value, [1, 0, 2]))):
            own = slice(index * d, (index + 1) * d)
            scale = 1 / math.sqrt(per_head) if index == 0 else 1.0
            y = graph.linear(x, weight[own] * scale, bias[own] * scale, f"{name}.{'qkv'[index]}")
            parts.append(graph.op("Transpose", graph.reshape(y, -1, self._heads, per_head), perm=order))
        shares = graph.op("Softmax", graph.op("MatMul", parts[0], parts[1]), axis=-1)
        heard = graph.reshape(graph.op("Transpose", graph.op("MatMul", shares, parts[2]), perm=[1, 0, 2]), -1, d)
        return graph.linear(heard, self._weights.take(f"{name}.out_proj.weight", d, d), self._weights.take(f"{name}.out_proj.bias", d), f"{name}.out_proj")

    def _fed_forward(self, x: str, name: str) -> str:
        y = self._graph.linear(x, self._weights.take(f"{name}.linear1.weight", self._wide, self._width), self._weights.take(f"{name}.linear1.bias", self._wide),
                               f"{name}.linear1")
        if self._activation == "relu":
            y = self._graph.op("Relu", y)
        else:
            erf = self._graph.op("Erf", self._graph.op("Mul", y, self._graph.constant(np.array(math.sqrt(0.5)), "sqrt_half")))
            y = self._graph.op("Mul", self._graph.op("Mul", y, self._graph.constant(np.array(0.5), "half")),
                               self._graph.op("Add", erf, self._graph.constant(np.array(1.0), "one")))
        return self._graph.linear(y, self._weights.take(f"{name}.linear2.weight", self._width, self._wide),
                                  self._weights.take(f"{name}.linear2.bias", self._width), f"{name}.linear2")

    def _added(self, x: str, y: str) -> str:
        return self._graph.op("Add", x, y)

    def encoded(self, x: str, places: str, layers: int) -> str:
        for layer in range(layers):
            name = f"model.encoder.layers.{layer}"
            y = self.norm(x, f"{name}.norm1") if self._norm_first else x
            placed = self._added(y, places)
            x = self._added(x, self._attention(f"{name}.self_attn", placed, placed, y))
            x = x if self._norm_first else self.norm(x, f"{name}.norm1")
            y = self.norm(x, f"{name}.norm2") if self._norm_first else x
            x = self._added(x, self._fed_forward(y, name))
            x = x if self._norm_first else self.norm(x, f"{name}.norm2")
        return self.norm(x, "model.encoder.norm") if self._norm_first else x

    def decoded(self, x: str, places: str, memory: str, memory_places: str, layers: int) -> str:
        keys = self._added(memory, memory_places)
        for layer in range(layers):
            name = f"model.decoder.layers.{layer}"
            y = self.norm(x, f"{name}.norm1") if self._norm_first else x
            placed = self._added(y, places)
            x = self._added(x, self._attention(f"{name}.self_attn", placed, placed, y))
            x = x if self._norm_first else self.norm(x, f"{name}.norm1")
            y = self.norm(x, f"{name}.norm2") if self._norm_first else x
            x = self._added(x, self._attention(f"{name}.multihead_attn", self._added(y, places), keys, memory))
            x = x if self._norm_first else self.norm(x, f"{name}.norm2")
            y = self.norm(x, f"{name}.norm3") if self._norm_first else x
            x = self._added(x, self._fed_forward(y, name))
            x = x if self._norm_first else self.norm(x, f"{name}.norm3")
        return self.norm(x, "model.decoder.norm")


def build(graph: Graph, checkpoint: Checkpoint) -> int:
    """Inputs by LeRobot's names, output "action", (1, steps, joints). Returns the steps of a chunk."""
    weights, width = checkpoint.weights, checkpoint.integer("dim_model", 4, 8192)
    steps, count = checkpoint.integer("chunk_size", 1, 128), checkpoint.action.shape[0]
    checkpoint.integer("n_obs_steps", 1, 1)
    checkpoint.refuse("replace_final_stride_with_dilation", "a dilated backbone is not exported")
    transformer = _Transformer(graph, checkpoint)
    latent = checkpoint.integer("latent_dim", 1, 8192)
    weights.take("model.encoder_latent_input_proj.weight", width, latent)  # times zero
    tokens: List[str] = [graph.constant(weights.take("model.encoder_latent_input_proj.bias", width)[None])]
    for kind, part in (("STATE", "robot_state"), ("ENV", "env_state")):
        for feature in checkpoint.of_kind(kind):
            x = graph.affine(graph.input(feature.name, 1, *feature.shape), *checkpoint.normal[feature.name])
            name = f"model.encoder_{part}_input_proj"
            tokens.append(graph.linear(x, weights.take(f"{name}.weight", width, *feature.shape), weights.take(f"{name}.bias", width), name))
    places: List[Array] = [weights.take("model.encoder_1d_feature_pos_embed.weight", len(tokens), width)]
    images = checkpoint.of_kind("VISUAL")
    if images:
        backbone = ResNet(graph, weights, checkpoint.choice("vision_backbone", tuple(BACKBONES)), lambda part: f"model.backbone.{part}", False)
        for feature in images:
            normal = checkpoint.normal[feature.name]
            shown = graph.affine(graph.input(feature.name, 1, *feature.shape), normal.gain.reshape(1, 3, 1, 1), normal.shift.reshape(1, 3, 1, 1))
            seen, (_, channels, height, columns) = backbone((shown, (1, *feature.shape)))  # type: ignore[arg-type]
            name = "model.encoder_img_feat_input_proj"
            projection = [graph.constant(weights.take(f"{name}.weight", width, channels, 1, 1), f"{name}.weight"),
                          graph.constant(weights.take(f"{name}.bias", width), f"{name}.bias")]
            pixels = graph.reshape(graph.op("Conv", seen, *projection, kernel_shape=[1, 1]), width, height * columns)
            tokens.append(graph.op("Transpose", pixels, perm=[1, 0]))
            places.append(_image_places(width, height, columns))
    elif not checkpoint.of_kind("ENV"):
        raise Refused(f"{checkpoint.folder}/config.json: input_features has neither an image nor the environment's state")
    all_places = graph.constant(np.concatenate(places))
    memory = transformer.encoded(graph.op("Concat", *tokens, axis=0), all_places, checkpoint.integer("n_encoder_layers", 1, 64))
    queries = graph.constant(weights.take("model.decoder_pos_embed.weight", steps, width))
    said = transformer.decoded(graph.constant(np.zeros((steps, width))), queries, memory, all_places, checkpoint.integer("n_decoder_layers", 1, 64))
    # The head's layer and the way back to targets, in one.
    normal = checkpoint.normal["action"]
    weight, bias = weights.take("model.action_head.weight", count, width), weights.take("model.action_head.bias", count)
    targets = graph.linear(said, weight * normal.gain[:, None], bias * normal.gain + normal.shift, "model.action_head")
    graph.output("action", graph.reshape(targets, 1, steps, count), 1, steps, count)
    weights.drop("model.vae_encoder")
    return steps
