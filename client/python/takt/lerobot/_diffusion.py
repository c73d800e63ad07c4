# SPDX-License-Identifier: Apache-2.0
"""Diffusion policy (Chi et al. 2023) as LeRobot runs it, denoised by DDIM (Song et al. 2020) without noise between its steps, all of them in one graph. Takt's sampler
draws the noise x and adds what the graph says: actions - x, in one step.

LeRobot's chunk begins with the oldest instant of the history, Takt's with the observation. So the rows of x before the observation stand at the end of Takt's chunk,
where the last target is held.
"""
import math
from typing import Dict, List, Sequence, Tuple

import numpy as np

from takt._refused import Refused
from takt.lerobot._checkpoint import Checkpoint, shown
from takt.lerobot._graph import Array, Graph
from takt.lerobot._resnet import BACKBONES, ResNet

USED = ("n_obs_steps", "horizon", "n_action_steps", "vision_backbone", "resize_shape", "crop_shape", "use_group_norm", "spatial_softmax_num_keypoints",
        "use_separate_rgb_encoder_per_camera", "down_dims", "kernel_size", "n_groups", "diffusion_step_embed_dim", "use_film_scale_modulation", "noise_scheduler_type",
        "num_train_timesteps", "beta_schedule", "beta_start", "beta_end", "prediction_type", "clip_sample", "clip_sample_range", "num_inference_steps")
OF_TRAINING = ("pretrained_backbone_weights", "crop_is_random", "crop_ratio", "drop_n_last_frames", "do_mask_loss_for_padding", "compile_model", "compile_mode",
               "gradient_checkpointing", "optimizer_lr", "optimizer_betas", "optimizer_eps", "optimizer_weight_decay", "scheduler_name", "scheduler_warmup_steps")
_FINAL_GROUPS = 8  # whatever n_groups is


def _mish(x: Array) -> Array:
    softened: Array = x * np.tanh(np.logaddexp(0, x))
    return softened


def _kept(checkpoint: Checkpoint) -> Array:
    """What is left of the signal after each training step, alphas_cumprod of diffusers: float32, summed up in float64."""
    count = checkpoint.integer("num_train_timesteps", 1, 10000)
    first, last = checkpoint.number("beta_start", 0, 1), checkpoint.number("beta_end", 0, 1)
    schedule = checkpoint.choice("beta_schedule", ("squaredcos_cap_v2", "linear", "scaled_linear"))
    if schedule == "squaredcos_cap_v2":
        def left(at: float) -> float:
            return math.cos((at + 0.008) / 1.008 * math.pi / 2) ** 2

        betas = np.array([min(1 - left((i + 1) / count) / left(i / count), 0.999) for i in range(count)], np.float32)
    elif schedule == "linear":
        betas = np.linspace(first, last, count).astype(np.float32)
    else:
        betas = np.linspace(math.sqrt(first), math.sqrt(last), count).astype(np.float32) ** 2
    kept: Array = np.cumprod((np.float32(1) - betas).astype(np.float64)).astype(np.float32).astype(np.float64)
    return kept


class _Unet:
    """The network that predicts the noise, or the actions, at one time of denoising."""

    def __init__(self, graph: Graph, checkpoint: Checkpoint, condition: str, condition_width: int, times: Sequence[int]) -> None:
        self._graph, self._weights, self._count = graph, checkpoint.weights, checkpoint.action.shape[0]
        self._width, self._kernel = checkpoint.integer("diffusion_step_embed_dim", 4, 4096), checkpoint.integer("kernel_size", 1, 31)
        self._groups, self._scaled = checkpoint.integer("n_groups", 1, 256), checkpoint.flag("use_film_scale_modulation")
        dims = checkpoint.config.get("down_dims")
        whole = isinstance(dims, list) and 0 < len(dims) <= 8 and all(type(one) is int and 0 < one <= 8192 and one % self._groups == 0 for one in dims)
        if not whole or dims[0] % _FINAL_GROUPS or self._kernel % 2 == 0 or self._width % 2:  # type: ignore[index]
            raise Refused(f"{checkpoint.folder}/config.json: down_dims {shown(dims)}, kernel_size {self._kernel}, diffusion_step_embed_dim {self._width}: LeRobot's network "
                          f"has up to 8 dimensions that are multiples of n_groups {self._groups}, the first of {_FINAL_GROUPS} too, an odd kernel, and an even embedding")
        self._dims: List[int] = dims  # type: ignore[assignment]
        self._condition, self._condition_width = graph.mish(condition), condition_width
        self._times = np.stack([_mish(self._time(one)) for one in times])
        self._shared: Dict[str, str] = {}
        self._timed: Dict[str, Array] = {}

    def _time(self, at: int) -> Array:
        """The embedding of a time: numbers of the file alone, so it is computed here."""
        half = self._width // 2
        rates = np.exp(np.arange(half, dtype=np.float32) * np.float32(-math.log(10000) / (half - 1)))
        angles = (np.float32(at) * rates).astype(np.float64)
        name = "diffusion.unet.diffusion_step_encoder"
        x: Array = np.concatenate((np.sin(angles), np.cos(angles)))
        for layer, out, into in ((1, 4 * self._width, self._width), (3, self._width, 4 * self._width)):
            x = self._weights.take(f"{name}.{layer}.weight", out, into) @ x + self._weights.take(f"{name}.{layer}.bias", out)
            x = _mish(x) if layer == 1 else x
        return x

    def _weight(self, name: str, *shape: int, spread: bool = False) -> str:
        """Every step of denoising has the same. `spread`: as (channels, 1)."""
        if name in self._graph:
            return name
        values = self._weights.take(name, *shape)
        return self._graph.constant(values[:, None] if spread else values, name)

    def _block(self, x: str, name: str, shape: Tuple[int, int, int], into: int, groups: int) -> str:
        """Convolution, group norm, Mish; `shape` is what it gives."""
        y = self._convolved(x, f"{name}.0", shape[1], into, self._kernel)
        gain, shift = (self._weight(f"{name}.1.{part}", shape[1], spread=True) for part in ("weight", "bias"))
        return self._graph.mish(self._graph.group_norm(y, shape, groups, gain, shift))

    def _modulation(self, name: str, out: int, step: int, part: slice) -> str:
        """(1, out, 1), of the observation and the time. What the observation gives is computed once for all steps."""
        key = f"{name}.{part.start}"
        if key not in self._shared:
            total = 2 * out if self._scaled else out
            weight, bias = self._weights.take(f"{name}.weight", total, self._width + self._condition_width), self._weights.take(f"{name}.bias", total)
            self._shared[key] = self._graph.reshape(self._graph.linear(self._condition, weight[part, self._width:], bias[part], key), 1, out, 1)
            self._timed[key] = self._times @ weight[part, :self._width].T
        return self._graph.op("Add", self._shared[key], self._graph.constant(self._timed[key][step].reshape(1, out, 1)))

    def _residual(self, x: str, name: str, into: int, out: int, length: int, step: int) -> str:
        shape = (1, out, length)
        y = self._block(x, f"{name}.conv1.block", shape, into, self._groups)
        film = f"{name}.cond_encoder.1"
        if self._scaled:
            y = self._graph.op("Mul", y, self._modulation(film, out, step, slice(0, out)))
        y = self._graph.op("Add", y, self._modulation(film, out, step, slice(out, 2 * out) if self._scaled else slice(0, out)))
        y = self._block(y, f"{name}.conv2.block", shape, out, self._groups)
        return self._graph.op("Add", y, self._convolved(x, f"{name}.residual_conv", out, into, 1) if into != out else x)

    def _convolved(self, x: str, name: str, out: int, into: int, kernel: int, stride: int = 1) -> str:
        weight, bias = self._weight(f"{name}.weight", out, into, kernel), self._weight(f"{name}.bias", out)
        return self._graph.op("Conv", x, weight, bias, kernel_shape=[kernel], strides=[stride], pads=[kernel // 2] * 2)

    def predict(self, x: str, length: int, step: int) -> str:
        """Of (1, actions, length), at the time of this step."""
        skips: List[str] = []
        into = self._count
        for index, out in enumerate(self._dims):
            name = f"diffusion.unet.down_modules.{index}"
            x = self._residual(self._residual(x, f"{name}.0", into, out, length, step), f"{name}.1", out, out, length, step)
            skips.append(x)
            into = out
            if index + 1 < len(self._dims):
                x, length = self._convolved(x, f"{name}.2", out, out, 3, 2), (length + 1) // 2
        for index in range(2):
            x = self._residual(x, f"diffusion.unet.mid_modules.{index}", into, into, length, step)
        for index, out in enumerate(reversed(self._dims[:-1])):
            name = f"diffusion.unet.up_modules.{index}"
            x = self._graph.op("Concat", x, skips.pop(), axis=1)
            x = self._residual(self._residual(x, f"{name}.0", 2 * into, out, length, step), f"{name}.1", out, out, length, step)
            weight, bias = self._weight(f"{name}.2.weight", out, out, 4), self._weight(f"{name}.2.bias", out)
            x = self._graph.op("ConvTranspose", x, weight, bias, kernel_shape=[4], strides=[2], pads=[1, 1])
            into, length = out, 2 * length
        x = self._block(x, "diffusion.unet.final_conv.0.block", (1, into, length), into, _FINAL_GROUPS)
        return self._convolved(x, "diffusion.unet.final_conv.1", self._count, into, 1)


def _seen(graph: Graph, checkpoint: Checkpoint, history: int) -> List[Tuple[str, int]]:
    """Features of each camera's images, (history, width)."""
    images, weights = checkpoint.of_kind("VISUAL"), checkpoint.weights
    if not images:
        return []
    checkpoint.refuse("resize_shape", "images that are resized before the network are not exported; record and train at the network's size")
    points, separate = checkpoint.integer("spatial_softmax_num_keypoints", 1, 4096), checkpoint.flag("use_separate_rgb_encoder_per_camera")
    crop = checkpoint.config.get("crop_shape")
    backbone, found = checkpoint.choice("vision_backbone", tuple(BACKBONES)), []
    for index, feature in enumerate(images):
        name = "diffusion.rgb_encoder" + (f".{index}" if separate else "")
        normal, (_, height, columns) = checkpoint.normal[feature.name], feature.shape
        x = graph.affine(graph.input(feature.name, history, *feature.shape), normal.gain.reshape(1, 3, 1, 1), normal.shift.reshape(1, 3, 1, 1))
        if crop is not None:
            if not isinstance(crop, list) or len(crop) != 2 or not all(type(one) is int for one in crop) or not (0 < crop[0] <= height and 0 < crop[1] <= columns):
                raise Refused(f"{checkpoint.folder}/config.json: crop_shape {shown(crop)} does not fit into {feature.name}, {height} x {columns}")
            for axis, (extent, kept) in ((2, (height, crop[0])), (3, (columns, crop[1]))):
                begin = round((extent - kept) / 2)
                x = graph.rows(x, begin, begin + kept, axis)
            height, columns = crop
        places = {"conv1": "0", "bn1": "1"}

        def part(of: str, name: str = name) -> str:
            layer, _, rest = of.partition(".")
            return f"{name}.backbone." + (places.get(layer) or f"{int(layer[5:]) + 3}.{rest}")

        y, (_, channels, rows, extent) = ResNet(graph, weights, backbone, part, checkpoint.flag("use_group_norm"))((x, (history, 3, height, columns)))
        kernel = [graph.constant(weights.take(f"{name}.pool.nets.weight", points, channels, 1, 1), f"{name}.pool.nets.weight"),
                  graph.constant(weights.take(f"{name}.pool.nets.bias", points), f"{name}.pool.nets.bias")]
        maps = graph.reshape(graph.op("Conv", y, *kernel, kernel_shape=[1, 1]), history * points, rows * extent)
        grid = graph.constant(weights.take(f"{name}.pool.pos_grid", rows * extent, 2), f"{name}.pool.pos_grid")
        centres = graph.reshape(graph.op("MatMul", graph.op("Softmax", maps, axis=-1), grid), history, 2 * points)
        weight, bias = weights.take(f"{name}.out.weight", 2 * points, 2 * points), weights.take(f"{name}.out.bias", 2 * points)
        found.append((graph.op("Relu", graph.linear(centres, weight, bias, f"{name}.out")), 2 * points))
    return found


def _observed(graph: Graph, checkpoint: Checkpoint) -> Tuple[str, int]:
    """(1, width): of each instant of the history state, images and environment."""
    history = checkpoint.integer("n_obs_steps", 1, 16)
    parts: List[Tuple[str, int]] = []
    for kind in ("STATE", "ENV"):
        for feature in checkpoint.of_kind(kind):
            x = graph.reshape(graph.input(feature.name, 1, history * feature.shape[0]), history, feature.shape[0])
            parts.append((graph.affine(x, *checkpoint.normal[feature.name]), feature.shape[0]))
    if not checkpoint.of_kind("STATE"):
        raise Refused(f"{checkpoint.folder}/config.json: input_features has no observation.state, which LeRobot's network needs")
    parts[1:1] = _seen(graph, checkpoint, history)
    if len(parts) < 2:
        raise Refused(f"{checkpoint.folder}/config.json: input_features has neither an image nor the environment's state")
    width = sum(one for _, one in parts)
    return graph.reshape(graph.op("Concat", *(one for one, _ in parts), axis=1), 1, history * width), history * width


def build(graph: Graph, checkpoint: Checkpoint, steps: int) -> int:
    """Inputs by LeRobot's names, then x_t and t; output "velocity", (1, horizon, joints), in normalised actions. `steps` of DDIM; 0: as config.json says. Returns the horizon."""
    kept = _kept(checkpoint)
    kind = checkpoint.choice("noise_scheduler_type", ("DDPM", "DDIM"))
    if kind == "DDPM" and not steps:
        raise Refused(f"{checkpoint.folder}/config.json: noise_scheduler_type DDPM draws noise in every step, and Takt's sampler draws it once. Say --ddim 10 to denoise by DDIM "
                      "in 10 steps, as LeRobot does with noise_scheduler_type DDIM and num_inference_steps 10")
    if not steps:
        steps = len(kept) if checkpoint.config.get("num_inference_steps") is None else checkpoint.integer("num_inference_steps", 1, len(kept))
    if not 0 < steps <= len(kept):
        raise Refused(f"--ddim {steps} is not from 1 to num_train_timesteps {len(kept)}")
    checkpoint.config = {**checkpoint.config, "num_inference_steps": steps}
    horizon, past, count = checkpoint.integer("horizon", 2, 128), checkpoint.integer("n_obs_steps", 1, 16) - 1, checkpoint.action.shape[0]
    checkpoint.integer("n_action_steps", 1, horizon - past)
    by_noise = checkpoint.choice("prediction_type", ("epsilon", "sample")) == "epsilon"
    limit = checkpoint.number("clip_sample_range", 1e-6, 1e6) if checkpoint.flag("clip_sample") else 0.0
    condition, width = _observed(graph, checkpoint)
    stride = len(kept) // steps
    times = [step * stride for step in reversed(range(steps))]
    unet = _Unet(graph, checkpoint, condition, width, times)
    if horizon % (1 << max(0, len(checkpoint.config["down_dims"]) - 1)):
        raise Refused(f"{checkpoint.folder}/config.json: horizon {horizon} cannot be halved {len(checkpoint.config['down_dims']) - 1} times, as down_dims ask")
    noise = graph.input("x_t", 1, horizon, count)
    graph.input("t", 1, 1)
    x = noise if not past else graph.op("Concat", graph.rows(noise, horizon - past, horizon, 1), graph.rows(noise, 0, horizon - past, 1), axis=1)
    x = graph.op("Transpose", x, perm=[0, 2, 1])
    for step, time in enumerate(times):
        signal, left = kept[time], kept[time - stride] if time >= stride else 1.0
        said = unet.predict(x, horizon, step)
        scaled = graph.op("Mul", x, graph.constant(np.array(1 / math.sqrt(signal) if by_noise else 1 / math.sqrt(1 - signal))))
        share = math.sqrt((1 - signal) / signal) if by_noise else math.sqrt(signal / (1 - signal))
        other = graph.op("Sub", scaled, graph.op("Mul", said, graph.constant(np.array(share))))
        actions, error = (other, said) if by_noise else (said, other)
        if limit:
            actions = graph.op("Clip", actions, graph.constant(np.array(-limit)), graph.constant(np.array(limit)))
        x = graph.op("Mul", actions, graph.constant(np.array(math.sqrt(left))))
        if left < 1:
            x = graph.op("Add", x, graph.op("Mul", error, graph.constant(np.array(math.sqrt(1 - left)))))
    actions = graph.op("Transpose", x, perm=[0, 2, 1])
    if past:
        actions = graph.op("Concat", graph.rows(actions, past, horizon, 1), *[graph.rows(actions, horizon - 1, horizon, 1)] * past, axis=1)
    graph.output("velocity", graph.op("Sub", actions, noise), 1, horizon, count)
    return horizon
