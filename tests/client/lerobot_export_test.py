#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a checkpoint folder of LeRobot becomes a robot file's policy by one command, with the folder's own numbers: normalisation, units and chunk inside; what
the file cannot carry is said or refused in one line. Method: folders in LeRobot's two layouts with small numbers of our own; takt.lerobot exports them, Takt's
engine answers observations, and the same network written in PyTorch's functions answers them too. One row of each was also computed by LeRobot's own classes.
Usage: lerobot_export_test.py SOURCE_DIR BUILD_DIR. Exit code 77: PyTorch is missing.
"""
import contextlib
import hashlib
import io
import json
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import types
import unittest
from unittest import mock

import numpy as np

try:
    import torch
    from torch.nn import functional as F
except ImportError as error:
    print(f"SKIPPED: {error}: NO CHECKPOINT WAS EXPORTED")
    sys.exit(77)

torch.set_num_threads(1)
SOURCE, BUILD = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
sys.dont_write_bytecode = True
sys.path.insert(0, str(SOURCE / "client/python"))
import takt  # noqa: E402
from takt.lerobot.__main__ import main  # noqa: E402

ROBOT = SOURCE / "config/arm6.yaml"
JOINTS = ("base_yaw=deg", "shoulder=deg", "elbow=rad", "wrist_roll=-100..100 is -90..90 deg", "wrist_pitch=100..0 is -1.5..1.5 rad", "wrist_yaw=0..100 is -10..95 deg")
GAIN = np.array([math.pi / 180, math.pi / 180, 1, 0.9 * math.pi / 180, -0.03, 1.05 * math.pi / 180])
SHIFT = np.array([0, 0, 0, 0, 1.5, -10 * math.pi / 180])
STATE, ENVIRONMENT = {"observation.state": ("STATE", [6])}, {"observation.environment_state": ("ENV", [4])}
CAMERAS = {"observation.images.front": ("VISUAL", [3, 40, 56]), "observation.images.wrist": ("VISUAL", [3, 40, 56])}
ACTION = {"action": ("ACTION", [6])}
STATISTICS = {"MEAN_STD": ("mean", "std"), "MIN_MAX": ("min", "max"), "IDENTITY": ()}
TRAINING = dict(device="cuda", use_amp=False, push_to_hub=True, repo_id=None, optimizer_lr=1e-5, optimizer_weight_decay=1e-4)
MODES = {"VISUAL": "MEAN_STD", "STATE": "MEAN_STD", "ENV": "MEAN_STD", "ACTION": "MEAN_STD"}
ACT = dict(TRAINING, type="act", n_obs_steps=1, chunk_size=12, n_action_steps=4, vision_backbone="resnet18", pretrained_backbone_weights="ResNet18_Weights.IMAGENET1K_V1",
           replace_final_stride_with_dilation=False, pre_norm=False, dim_model=32, n_heads=4, dim_feedforward=48, feedforward_activation="relu", n_encoder_layers=2,
           n_decoder_layers=1, use_vae=True, latent_dim=8, n_vae_encoder_layers=1, temporal_ensemble_coeff=None, dropout=0.1, kl_weight=10.0, optimizer_lr_backbone=1e-5,
           normalization_mapping=MODES)
DIFFUSION = dict(TRAINING, type="diffusion", n_obs_steps=2, horizon=16, n_action_steps=8, drop_n_last_frames=7, vision_backbone="resnet18", crop_shape=[33, 49],
                 crop_is_random=True, pretrained_backbone_weights=None, use_group_norm=True, spatial_softmax_num_keypoints=8, use_separate_rgb_encoder_per_camera=False,
                 down_dims=[16, 32, 48], kernel_size=5, n_groups=4, diffusion_step_embed_dim=16, use_film_scale_modulation=True, noise_scheduler_type="DDIM",
                 num_train_timesteps=100, beta_schedule="squaredcos_cap_v2", beta_start=0.0001, beta_end=0.02, prediction_type="epsilon", clip_sample=True,
                 clip_sample_range=1.0, num_inference_steps=10, do_mask_loss_for_padding=False, optimizer_betas=[0.95, 0.999], optimizer_eps=1e-8, scheduler_name="cosine",
                 scheduler_warmup_steps=500, normalization_mapping=dict(MODES, STATE="MIN_MAX", ENV="MIN_MAX", ACTION="MIN_MAX"))


def safetensors(path, tensors):
    header, at = {}, 0
    for name, values in tensors.items():
        header[name] = {"dtype": "F32", "shape": list(values.shape), "data_offsets": [at, at + values.nbytes]}
        at += values.nbytes
    head = json.dumps(header).encode()
    path.write_bytes(len(head).to_bytes(8, "little") + head + b"".join(values.tobytes() for values in tensors.values()))


class Made(dict):
    """Tensors of our own, by name: the same on every machine."""

    def __init__(self, seed):
        super().__init__()
        self.random = np.random.RandomState(seed)

    def add(self, name, *shape, around=0.0, spread=None):
        scale = 1 / math.sqrt(max(1, math.prod(shape[1:]))) if spread is None else spread
        self[name] = (around + scale * self.random.uniform(-1.7, 1.7, shape)).astype(np.float32)

    def linear(self, name, out, into, *kernel):
        self.add(f"{name}.weight", out, into, *kernel)
        self.add(f"{name}.bias", out, spread=0.1)

    def norm(self, name, width, batch=False):
        self.add(f"{name}.weight", width, around=1, spread=0.2)
        self.add(f"{name}.bias", width, spread=0.1)
        if batch:
            self.add(f"{name}.running_mean", width, spread=0.1)
            self.add(f"{name}.running_var", width, around=1, spread=0.3)

    def resnet18(self, name, batch):
        self.add(name("conv1") + ".weight", 64, 3, 7, 7)
        self.norm(name("bn1"), 64, batch)
        for layer, out in enumerate((64, 128, 256, 512), 1):
            for block in range(2):
                into = out // 2 if layer > 1 and block == 0 else out
                part = f"layer{layer}.{block}."
                for index, channels in ((1, into), (2, out)):
                    self.add(name(f"{part}conv{index}") + ".weight", out, channels, 3, 3)
                    self.norm(name(f"{part}bn{index}"), out, batch)
                if into != out:
                    self.add(name(f"{part}downsample.0") + ".weight", out, into, 1, 1)
                    self.norm(name(f"{part}downsample.1"), out, batch)


def resnet18(weights, name, x, batch):
    def convolved(y, conv, norm, stride=1):
        weight = weights[name(conv) + ".weight"]
        y = F.conv2d(y, weight, stride=stride, padding=weight.shape[-1] // 2)
        gain, shift = weights[name(norm) + ".weight"], weights[name(norm) + ".bias"]
        if not batch:
            return F.group_norm(y, y.shape[1] // 16, gain, shift)
        return F.batch_norm(y, weights[name(norm) + ".running_mean"], weights[name(norm) + ".running_var"], gain, shift)

    x = F.max_pool2d(F.relu(convolved(x, "conv1", "bn1", 2)), 3, 2, 1)
    for layer in range(1, 5):
        for block in range(2):
            part, stride = f"layer{layer}.{block}.", 2 if layer > 1 and block == 0 else 1
            y = convolved(F.relu(convolved(x, part + "conv1", part + "bn1", stride)), part + "conv2", part + "bn2")
            x = F.relu(y + (convolved(x, part + "downsample.0", part + "downsample.1", stride) if stride == 2 else x))
    return x


def act_weights(config, inputs, seed=1):
    made, d = Made(seed), config["dim_model"]
    if any(kind == "VISUAL" for kind, _ in inputs.values()):
        made.resnet18(lambda part: f"model.backbone.{part}", True)
        made.linear("model.encoder_img_feat_input_proj", d, 512, 1, 1)

    def layer(name, norms, attentions):
        for attention in attentions:
            made.add(f"{name}.{attention}.in_proj_weight", 3 * d, d)
            made.add(f"{name}.{attention}.in_proj_bias", 3 * d, spread=0.1)
            made.linear(f"{name}.{attention}.out_proj", d, d)
        made.linear(f"{name}.linear1", config["dim_feedforward"], d)
        made.linear(f"{name}.linear2", d, config["dim_feedforward"])
        for index in range(norms):
            made.norm(f"{name}.norm{index + 1}", d)

    for index in range(config["n_encoder_layers"]):
        layer(f"model.encoder.layers.{index}", 2, ("self_attn",))
    if config["pre_norm"]:
        made.norm("model.encoder.norm", d)
    for index in range(config["n_decoder_layers"]):
        layer(f"model.decoder.layers.{index}", 3, ("self_attn", "multihead_attn"))
    made.norm("model.decoder.norm", d)
    tokens = 1
    for name, part in (("observation.state", "robot_state"), ("observation.environment_state", "env_state")):
        if name in inputs:
            made.linear(f"model.encoder_{part}_input_proj", d, inputs[name][1][0])
            tokens += 1
    made.linear("model.encoder_latent_input_proj", d, config["latent_dim"])
    made.add("model.encoder_1d_feature_pos_embed.weight", tokens, d, spread=0.5)
    made.add("model.decoder_pos_embed.weight", config["chunk_size"], d, spread=0.5)
    made.linear("model.action_head", 6, d)
    if config["use_vae"]:
        made.add("model.vae_encoder_cls_embed.weight", 1, d)  # one of those that inference never reads
    return made


def act(config, weights, shown):
    """(steps, 6), normalised, of normalised inputs."""
    d, first = config["dim_model"], config["pre_norm"]

    def linear(x, name):
        return F.linear(x, weights[name + ".weight"], weights[name + ".bias"])

    def norm(x, name):
        return F.layer_norm(x, (d,), weights[name + ".weight"], weights[name + ".bias"])

    def attended(name, q, k, v):
        return F.multi_head_attention_forward(q, k, v, d, config["n_heads"], weights[name + ".in_proj_weight"], weights[name + ".in_proj_bias"], None, None, False, 0.0,
                                              weights[name + ".out_proj.weight"], weights[name + ".out_proj.bias"], training=False, need_weights=False)[0]

    def fed(x, name):
        return linear(getattr(F, config["feedforward_activation"])(linear(x, name + ".linear1")), name + ".linear2")

    def layer(x, name, parts):
        for index, part in enumerate(parts, 1):
            y = norm(x, f"{name}.norm{index}") if first else x
            x = x + part(y, name)
            x = x if first else norm(x, f"{name}.norm{index}")
        return x

    tokens = [weights["model.encoder_latent_input_proj.bias"][None]]
    for name, part in (("observation.state", "robot_state"), ("observation.environment_state", "env_state")):
        if name in shown:
            tokens.append(linear(shown[name], f"model.encoder_{part}_input_proj"))
    places = [weights["model.encoder_1d_feature_pos_embed.weight"]]
    for name in (name for name in shown if ".images." in name):
        seen = resnet18(weights, lambda part: f"model.backbone.{part}", shown[name], True)
        seen = F.conv2d(seen, weights["model.encoder_img_feat_input_proj.weight"], weights["model.encoder_img_feat_input_proj.bias"])[0]
        place = torch.zeros_like(seen)
        for channel in range(d):
            half, index = divmod(channel, d // 2)
            extent = seen.shape[1 + half]
            angle = torch.arange(1, extent + 1) / (extent + 1e-6) * 2 * math.pi / 10000 ** (2 * (index // 2) / (d // 2))
            wave = torch.cos(angle) if index % 2 else torch.sin(angle)
            place[channel] = wave[:, None] if half == 0 else wave[None, :]
        tokens.append(seen.flatten(1).T)
        places.append(place.flatten(1).T)
    x, place = torch.cat(tokens)[:, None], torch.cat(places)[:, None]
    for index in range(config["n_encoder_layers"]):
        x = layer(x, f"model.encoder.layers.{index}", [lambda y, name: attended(name + ".self_attn", y + place, y + place, y), fed])
    memory = norm(x, "model.encoder.norm") if first else x
    query = weights["model.decoder_pos_embed.weight"][:, None]
    x = torch.zeros(config["chunk_size"], 1, d)
    for index in range(config["n_decoder_layers"]):
        x = layer(x, f"model.decoder.layers.{index}", [lambda y, name: attended(name + ".self_attn", y + query, y + query, y),
                                                      lambda y, name: attended(name + ".multihead_attn", y + query, memory + place, memory), fed])
    return linear(norm(x, "model.decoder.norm")[:, 0], "model.action_head")


def diffusion_weights(config, inputs, seed=4):
    made, images, points = Made(seed), [name for name in inputs if ".images." in name], config["spatial_softmax_num_keypoints"]
    separate = config["use_separate_rgb_encoder_per_camera"]
    for index in range(len(images) if separate else min(1, len(images))):
        name = "diffusion.rgb_encoder" + (f".{index}" if separate else "")
        made.resnet18(in_sequence(name + ".backbone."), not config["use_group_norm"])
        made.linear(name + ".pool.nets", points, 512, 1, 1)
        rows, columns = ((extent + 31) // 32 for extent in config["crop_shape"] or inputs[images[0]][1][1:])
        made[name + ".pool.pos_grid"] = np.stack(np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows)), -1).reshape(-1, 2).astype(np.float32)
        made.linear(name + ".out", 2 * points, 2 * points)
    embedded, dims = config["diffusion_step_embed_dim"], config["down_dims"]
    width = embedded + config["n_obs_steps"] * (sum(shape[0] for kind, shape in inputs.values() if kind != "VISUAL") + 2 * points * len(images))
    made.linear("diffusion.unet.diffusion_step_encoder.1", 4 * embedded, embedded)
    made.linear("diffusion.unet.diffusion_step_encoder.3", embedded, 4 * embedded)

    def block(name, out, into):
        made.linear(name + ".0", out, into, config["kernel_size"])
        made.norm(name + ".1", out)

    def residual(name, out, into):
        block(name + ".conv1.block", out, into)
        made.linear(name + ".cond_encoder.1", (1 + config["use_film_scale_modulation"]) * out, width)
        block(name + ".conv2.block", out, out)
        if out != into:
            made.linear(name + ".residual_conv", out, into, 1)

    for index, (out, into) in enumerate(zip(dims, [6, *dims])):
        residual(f"diffusion.unet.down_modules.{index}.0", out, into)
        residual(f"diffusion.unet.down_modules.{index}.1", out, out)
        if index + 1 < len(dims):
            made.linear(f"diffusion.unet.down_modules.{index}.2", out, out, 3)
    for index in range(2):
        residual(f"diffusion.unet.mid_modules.{index}", dims[-1], dims[-1])
    for index, (out, into) in enumerate(zip(dims[-2::-1], dims[::-1])):
        residual(f"diffusion.unet.up_modules.{index}.0", out, 2 * into)
        residual(f"diffusion.unet.up_modules.{index}.1", out, out)
        made.linear(f"diffusion.unet.up_modules.{index}.2", out, out, 4)
    block("diffusion.unet.final_conv.0.block", dims[0], dims[0])
    made.linear("diffusion.unet.final_conv.1", 6, dims[0], 1)
    return made


def in_sequence(name):
    """Names of a ResNet's parts in a list: conv1, bn1, ReLU, pooling, and the four layers."""
    def of(part):
        first, _, rest = part.partition(".")
        return name + {"conv1": "0", "bn1": "1"}.get(first, f"{int(first[-1]) + 3}." + rest if rest else "")

    return of


def diffusion(config, weights, shown, x):
    """(horizon, 6), normalised actions from the oldest instant of the history on, of normalised inputs and of noise (horizon, 6)."""
    images, separate = [name for name in shown if ".images." in name], config["use_separate_rgb_encoder_per_camera"]

    def linear(y, name):
        return F.linear(y, weights[name + ".weight"], weights[name + ".bias"])

    features = [shown["observation.state"]]
    for index, image in enumerate(images):
        name, y = "diffusion.rgb_encoder" + (f".{index}" if separate else ""), shown[image]
        if config["crop_shape"]:
            top, left = (round((whole - part) / 2) for whole, part in zip(y.shape[2:], config["crop_shape"]))
            y = y[:, :, top:top + config["crop_shape"][0], left:left + config["crop_shape"][1]]
        y = resnet18(weights, in_sequence(name + ".backbone."), y, not config["use_group_norm"])
        y = F.conv2d(y, weights[name + ".pool.nets.weight"], weights[name + ".pool.nets.bias"])
        centres = torch.softmax(y.flatten(2), -1) @ weights[name + ".pool.pos_grid"]
        features.append(F.relu(linear(centres.flatten(1), name + ".out")))
    features += [shown[name] for name in shown if name.endswith("environment_state")]
    seen = torch.cat(features, 1).reshape(1, -1)

    def block(y, name, groups):
        y = F.conv1d(y, weights[name + ".0.weight"], weights[name + ".0.bias"], padding=config["kernel_size"] // 2)
        return F.mish(F.group_norm(y, groups, weights[name + ".1.weight"], weights[name + ".1.bias"]))

    def residual(y, name, condition):
        z = block(y, name + ".conv1.block", config["n_groups"])
        film = linear(F.mish(condition), name + ".cond_encoder.1")[0, :, None]
        z = film[:z.shape[1]] * z + film[z.shape[1]:] if config["use_film_scale_modulation"] else z + film
        z = block(z, name + ".conv2.block", config["n_groups"])
        return z + (F.conv1d(y, weights[name + ".residual_conv.weight"], weights[name + ".residual_conv.bias"]) if name + ".residual_conv.bias" in weights else y)

    def unet(y, time):
        half, name, skips = config["diffusion_step_embed_dim"] // 2, "diffusion.unet.", []
        angles = time * torch.exp(torch.arange(half) * (-math.log(10000) / (half - 1)))
        timed = linear(F.mish(linear(torch.cat((angles.sin(), angles.cos()))[None], name + "diffusion_step_encoder.1")), name + "diffusion_step_encoder.3")
        condition, levels = torch.cat((timed, seen), 1), len(config["down_dims"])
        for index in range(levels):
            part = f"{name}down_modules.{index}."
            y = residual(residual(y, part + "0", condition), part + "1", condition)
            skips.append(y)
            if index + 1 < levels:
                y = F.conv1d(y, weights[part + "2.weight"], weights[part + "2.bias"], stride=2, padding=1)
        y = residual(residual(y, name + "mid_modules.0", condition), name + "mid_modules.1", condition)
        for index in range(levels - 1):
            part = f"{name}up_modules.{index}."
            y = residual(residual(torch.cat((y, skips.pop()), 1), part + "0", condition), part + "1", condition)
            y = F.conv_transpose1d(y, weights[part + "2.weight"], weights[part + "2.bias"], stride=2, padding=1)
        return F.conv1d(block(y, name + "final_conv.0.block", 8), weights[name + "final_conv.1.weight"], weights[name + "final_conv.1.bias"])

    count, steps = config["num_train_timesteps"], config["num_inference_steps"]
    if config["beta_schedule"] == "linear":
        betas = torch.linspace(config["beta_start"], config["beta_end"], count)
    else:
        at = [math.cos((i / count + 0.008) / 1.008 * math.pi / 2) ** 2 for i in range(count + 1)]
        betas = torch.tensor([min(1 - after / before, 0.999) for before, after in zip(at, at[1:])])
    kept = torch.cumprod(1 - betas, 0)
    x = x.T[None]
    for time in range((steps - 1) * (count // steps), -1, -(count // steps)):
        said, signal = unet(x, time), kept[time]
        if config["prediction_type"] == "epsilon":
            actions, error = (x - (1 - signal) ** 0.5 * said) / signal ** 0.5, said
        else:
            actions, error = said, (x - signal ** 0.5 * said) / (1 - signal) ** 0.5
        if config["clip_sample"]:
            actions = actions.clamp(-config["clip_sample_range"], config["clip_sample_range"])
        left = kept[time - count // steps] if time >= count // steps else torch.tensor(1.0)
        x = left ** 0.5 * actions + (1 - left) ** 0.5 * error
    return x[0].T


def stand_in(config, weights, inputs, found, modes, older):
    """Modules named as LeRobot's, with the network above."""
    tensors = {key: torch.tensor(values) for key, values in weights.items()}
    policy = types.SimpleNamespace(config=types.SimpleNamespace(device="cuda"))
    policy.to = lambda device: policy
    policy.eval = lambda: policy
    policy.model = lambda batch: (act(config, tensors, {name: batch[name] for name in inputs})[None], None)
    # One time of denoising, at which the network above goes the whole way.
    kept = {}

    def condition(batch):
        kept["shown"] = {name: batch["observation.images"][0, :, list(inputs).index(name) - 1] if ".images." in name else batch[name][0] for name in inputs}
        return torch.zeros(1)

    scheduler = types.SimpleNamespace(timesteps=[torch.tensor(0)], set_timesteps=lambda steps: None, step=lambda said, time, x: types.SimpleNamespace(prev_sample=said))
    policy.diffusion = types.SimpleNamespace(noise_scheduler=scheduler, _prepare_global_conditioning=condition,
                                             unet=lambda x, time, global_cond: diffusion(config, tensors, kept["shown"], x[0])[None])
    policy.normalize_inputs = lambda batch: {name: normalised(values, modes[inputs[name][0]], found[name], True) for name, values in batch.items()}
    policy.unnormalize_outputs = lambda batch: {"action": restored(batch["action"], modes["ACTION"], found["action"])}

    def processors(config, pretrained_path, preprocessor_overrides, postprocessor_overrides):
        assert not older and preprocessor_overrides == postprocessor_overrides == {"device_processor": {"device": "cpu"}} and config.device == "cpu"
        return (lambda batch: {name: normalised(values[None], modes[inputs[name][0]], found[name], False).float() for name, values in batch.items()},
                lambda action: restored(action, modes["ACTION"], found["action"]))

    factory = types.ModuleType("lerobot.policies.factory")
    factory.get_policy_class = lambda kind: types.SimpleNamespace(from_pretrained=lambda folder: policy)
    factory.make_pre_post_processors = processors
    sys.modules.update({"lerobot": types.ModuleType("lerobot"), "lerobot.policies": types.ModuleType("lerobot.policies"), "lerobot.policies.factory": factory})
    return policy


def takt_noise(seed, observation, count):
    """What Takt's sampler draws (policy_host/flow/flow_policy.cpp): splitmix64's counter, and Box and Muller's normal numbers of it."""
    whole = (1 << 64) - 1

    def mixed(value):
        value = (value + 0x9E3779B97F4A7C15) & whole
        value = ((value ^ (value >> 30)) * 0xBF58476D1CE4E5B9) & whole
        value = ((value ^ (value >> 27)) * 0x94D049BB133111EB) & whole
        return value ^ (value >> 31)

    state, drawn = mixed(mixed(mixed(seed) ^ observation)), []
    while len(drawn) < count:
        one, two = (mixed((state + i) & whole) / (1 << 11) // 1 * 2.0**-53 for i in range(2))
        state += 2
        drawn += [math.sqrt(-2 * math.log(1 - one)) * wave(2 * math.pi * two) for wave in (math.cos, math.sin)]
    return np.array(drawn[:count], np.float32)


def statistics(features, seed=2):
    random, found = np.random.RandomState(seed), {}
    for name, (kind, shape) in features.items():
        form = (3, 1, 1) if kind == "VISUAL" else tuple(shape)
        ranges = dict(mean=(0.3, 0.6), std=(0.2, 0.3), min=(0, 0.05), max=(0.9, 1)) if kind == "VISUAL" else dict(mean=(-1, 1), std=(0.5, 2), min=(-3, -2), max=(2, 3))
        found[name] = {key: random.uniform(*ends, form).astype(np.float32) for key, ends in ranges.items()}
    return found


def normalised(x, mode, of, older):
    if mode == "MEAN_STD":
        return (x - of["mean"]) / (of["std"] + 1e-8)
    return x if mode == "IDENTITY" else 2 * (x - of["min"]) / (of["max"] - of["min"] + (1e-8 if older else 0)) - 1


def restored(x, mode, of):
    return x * of["std"] + of["mean"] if mode == "MEAN_STD" else (x + 1) / 2 * (of["max"] - of["min"]) + of["min"]


class LeRobotExport(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="takt-lerobot."))
        self.addCleanup(shutil.rmtree, self.folder)
        self.checkpoint = self.folder / "checkpoint"

    def clear(self):
        for path in self.folder.iterdir():
            path.unlink() if path.is_file() else shutil.rmtree(path)

    def write(self, config, weights, inputs, older=False):
        """The folder, as LeRobot saves it."""
        self.checkpoint.mkdir(exist_ok=True)
        features = {name: {"type": kind, "shape": shape} for name, (kind, shape) in (inputs | ACTION).items()}
        config = dict(config, input_features={name: features[name] for name in inputs}, output_features={"action": features["action"]})
        (self.checkpoint / "config.json").write_text(json.dumps(config))
        modes, found = config["normalization_mapping"], statistics(inputs | ACTION)
        weights = dict(weights)
        if older:
            for part, names in (("normalize_inputs", inputs), ("normalize_targets", ACTION), ("unnormalize_outputs", ACTION)):
                for name in names:
                    for key in STATISTICS[modes[features[name]["type"]]]:
                        weights[f"{part}.buffer_{name.replace('.', '_')}.{key}"] = found[name][key]
        else:
            device = {"registry_name": "device_processor", "config": {"device": "cuda", "float_dtype": None}}
            before = [{"registry_name": "rename_observations_processor", "config": {"rename_map": {}}}, {"registry_name": "to_batch_processor", "config": {}}, device]
            for name, kind, steps, index in (("policy_preprocessor", "normalizer_processor", before, 3), ("policy_postprocessor", "unnormalizer_processor", [], 0)):
                state = f"{name}_step_{index}_{kind}.safetensors"
                own = {"registry_name": kind, "config": {"eps": 1e-8, "features": features, "norm_map": modes}, "state_file": state}
                (self.checkpoint / f"{name}.json").write_text(json.dumps({"name": name, "steps": [*steps, own]}))
                safetensors(self.checkpoint / state, {f"{feature}.{key}": values for feature, keys in found.items() for key, values in keys.items()})
        safetensors(self.checkpoint / "model.safetensors", weights)
        return found

    def export(self, *more, joints=JOINTS, robot=ROBOT, out="robot.yaml", fps="30"):
        """As the command does; only that it costs no new Python."""
        arguments = ["export", self.checkpoint, "--robot", robot, "--out", self.folder / out, "--fps", fps, *(text for name in joints for text in ("--joint", name)), *more]
        said = io.StringIO()
        try:
            with contextlib.redirect_stdout(said):
                code, line = main([str(argument) for argument in arguments]), ""
        except takt.Refused as refusal:
            code, line = refusal.exit_code, f"{refusal}\n"
        return subprocess.CompletedProcess(arguments, code, said.getvalue(), line)

    def refused(self, line, *more, code=65, **kinds):
        done = self.export(*more, **kinds)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
        self.assertIn(line, done.stderr)
        self.assertEqual(done.stdout, "")
        self.assertEqual([path.name for path in self.folder.iterdir()], ["checkpoint"])

    def takt(self, *arguments):
        return subprocess.run([BUILD / "bin/takt", *arguments], cwd=self.folder, capture_output=True, text=True, timeout=120, check=False)

    def answers(self, observations):
        """What Takt's host computes, as its own program of the tests runs it."""
        path = self.folder / "robot.yaml"
        path.write_text(path.read_text().replace("file: robot.onnx\n", "file: robot.onnx\n  engine: { name: builtin }\n"))
        np.stack(observations).astype(np.float32).tofile(self.folder / "shown")
        done = subprocess.run([BUILD / "bin/takt-engine-answers", path, self.folder / "shown", "", self.folder / "said"], capture_output=True, text=True, timeout=120, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return np.fromfile(self.folder / "said", np.float32).reshape(len(observations), -1, 6)

    def shown(self, inputs, count, older, modes, found, history=1):
        """Observations as Takt fills them, (values,), and as the network in PyTorch is shown them, normalised, (history, ...)."""
        random, rows, batches = np.random.RandomState(3), [], []
        for _ in range(count):
            row, batch = [], {}
            for name, (kind, shape) in inputs.items():
                values = random.uniform(-1, 1, (history, *shape)) if kind != "VISUAL" else random.randint(0, 256, (history, *shape)) / 255
                row.append(values.ravel())
                data = (values - SHIFT) / GAIN if kind == "STATE" else values
                batch[name] = torch.tensor(normalised(data, modes[kind], found[name], older), dtype=torch.float32)
            rows.append(np.concatenate(row))
            batches.append(batch)
        return rows, batches

    def test_an_act_policy_says_the_folders_numbers(self):
        cases = (
            ("newer", {}, STATE | CAMERAS, False, [0.46269, 0.9053, 0.30269, -0.31629, 0.76594, 0.08087]),
            ("older", {"normalization_mapping": dict(MODES, STATE="MIN_MAX", ACTION="MIN_MAX", VISUAL="IDENTITY")}, STATE | CAMERAS, True,
             [0.85724, -0.09501, 1.41255, 1.47587, 1.12527, -1.02186]),
            ("norms first, no images", {"pre_norm": True, "feedforward_activation": "gelu", "n_decoder_layers": 2, "use_vae": False}, STATE | ENVIRONMENT, False,
             [1.28932, 0.23967, 1.73836, -1.67381, 1.957, 0.76751]),
        )
        for name, changes, inputs, older, by_lerobot in cases:  # by_lerobot: the last step of the first answer, in the data set's units
            with self.subTest(name):
                self.clear()
                config = ACT | changes
                weights = act_weights(config, inputs)
                found, modes = self.write(config, weights, inputs, older), config["normalization_mapping"]
                done = self.export("--period", "33 ms")
                self.assertEqual(done.returncode, 0, done.stderr)
                rows, batches = self.shown(inputs, 3, older, modes, found)
                said = (self.answers(rows) - SHIFT) / GAIN
                tensors = {key: torch.tensor(values) for key, values in weights.items()}
                with torch.inference_mode():
                    wanted = np.stack([restored(act(config, tensors, batch).numpy().astype(np.float64), modes["ACTION"], found["action"]) for batch in batches])
                print(f"{name}: largest difference {abs(said - wanted).max():.1e} of {np.ptp(wanted):.2f}, between observations {abs(wanted[0] - wanted[1]).max():.2f}")
                self.assertLess(abs(said - wanted).max(), 1e-4)
                self.assertLess(abs(said[0, -1] - by_lerobot).max(), 1e-4)
                self.assertGreater(abs(wanted[0] - wanted[1]).max(), 0.05)

    def test_a_diffusion_policy_says_the_folders_numbers(self):
        free = {"clip_sample": False, "beta_schedule": "linear", "num_train_timesteps": 20, "num_inference_steps": None, "use_film_scale_modulation": False,
                "use_separate_rgb_encoder_per_camera": True, "crop_shape": None, "down_dims": [16, 24], "use_group_norm": False}
        cases = (
            ("newer", {}, STATE | ENVIRONMENT | CAMERAS, False, (), [2.20502, -1.22827, -0.47137, 1.71662, 0.26239, 0.1993]),
            ("older", free, STATE | CAMERAS, True, (), [2.56772, 0.57174, 5.11164, -0.08662, 1.80711, 0.67762]),
            ("DDPM by DDIM, three instants", {"prediction_type": "sample", "noise_scheduler_type": "DDPM", "num_inference_steps": None, "n_obs_steps": 3, "clip_sample_range": 1.5},
             STATE | ENVIRONMENT, False, ("--ddim", "5"), [-1.51751, 1.02577, 0.85733, -1.28851, 0.53657, -1.41053]),
        )
        for name, changes, inputs, older, more, by_lerobot in cases:  # by_lerobot: the fourth step of the first answer, in the data set's units
            with self.subTest(name):
                self.clear()
                config = DIFFUSION | changes
                weights = diffusion_weights(config, inputs)
                found, modes = self.write(config, weights, inputs, older), config["normalization_mapping"]
                done = self.export(*more)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("policy.period 33 ms (as far apart as its history's instants were in training, in whole ms)", done.stdout)
                config = config | {"num_inference_steps": int(more[1]) if more else config["num_inference_steps"] or config["num_train_timesteps"]}
                past, steps = config["n_obs_steps"] - 1, config["horizon"]
                rows, batches = self.shown(inputs, 3, older, modes, found, past + 1)
                context = [[id, 0, 0, 0, 0] + [0] * (steps * 6) for id in range(1, 4)]  # a sampler's: the observation's number, and no path
                raw = self.answers([np.concatenate(pair) for pair in zip(rows, context)])
                check, text = self.takt("config", "check", "robot.yaml"), (self.folder / "robot.yaml").read_text()
                self.assertEqual(check.returncode, 0, check.stderr)
                gain = np.array(json.loads(re.search(r"scale: (\[.*\])", text)[1]))
                shift = np.array(json.loads(re.search(r"offset: (\[.*\])", text)[1].replace(" rad", "")))
                said = (shift + gain * raw - SHIFT) / GAIN
                tensors, wanted = {key: torch.tensor(values) for key, values in weights.items()}, []
                for id, batch in enumerate(batches, 1):
                    noise = np.roll(takt_noise(1, id, steps * 6).reshape(steps, 6), past, axis=0)  # Takt's first step is the observation's instant
                    with torch.inference_mode():
                        actions = diffusion(config, tensors, batch, torch.tensor(noise)).numpy().astype(np.float64)
                    wanted.append(restored(actions, modes["ACTION"], found["action"])[past:])
                wanted = np.stack(wanted)
                print(f"{name}: largest difference {abs(said[:, :steps - past] - wanted).max():.1e} of {np.ptp(wanted):.2f}, between observations "
                      f"{abs(wanted[0] - wanted[1]).max():.2f}")
                self.assertLess(abs(said[:, :steps - past] - wanted).max(), 1e-4)
                self.assertLess(abs(said[0, 3] - by_lerobot).max(), 1e-4)
                self.assertLess(abs(said[:, steps - past:] - said[:, steps - past - 1:steps - past]).max(initial=0), 1e-5)  # what it does not say: the last target, held
                self.assertGreater(abs(wanted[0] - wanted[1]).max(), 0.05)

    def test_a_diffusion_policy_is_refused_by_its_meaning(self):
        weights = diffusion_weights(DIFFUSION, STATE | ENVIRONMENT)
        for changes, line in (({"noise_scheduler_type": "DDPM"}, "DDPM draws noise in every step, and Takt's sampler draws it once. Say --ddim 10"),
                              ({"num_inference_steps": 101}, "num_inference_steps is 101"), ({"n_action_steps": 16}, "n_action_steps is 16, and it must be a whole number from 1 to 15"),
                              ({"down_dims": [16, 30]}, "down_dims [16, 30]"), ({"horizon": 14}, "horizon 14 cannot be halved 2 times"), ({"prediction_type": "v"}, "prediction_type is v"),
                              ({"down_dims": [16, 32]}, "has the shape"), ({"beta_schedule": "sigmoid"}, "beta_schedule is sigmoid")):
            with self.subTest(line):
                self.write(DIFFUSION | changes, weights, STATE | ENVIRONMENT)
                self.refused(line)
        for changes, line in (({"resize_shape": [20, 20]}, "resize_shape is [20, 20]: images that are resized"), ({"crop_shape": [64, 64]}, "crop_shape [64, 64] does not fit")):
            with self.subTest(line):
                self.write(DIFFUSION | changes, weights, STATE | CAMERAS)
                self.refused(line)
        self.write(DIFFUSION, weights, STATE)
        self.refused("input_features has neither an image nor the environment's state")
        self.small()
        self.refused("--ddim 5 is for diffusion policies", "--ddim", "5", code=64)

    def test_a_run_is_compared_with_what_lerobot_says(self):
        """LeRobot's place is taken by the network above, and the run's by the answers of Takt's host: the numbers' way between them is what is tried."""
        for kind, config, inputs, older in (("act", ACT, STATE | CAMERAS, False), ("act", ACT, STATE | ENVIRONMENT, True), ("diffusion", DIFFUSION, STATE | CAMERAS, False)):
            with self.subTest(f"{kind}, {'older' if older else 'newer'}"):
                self.clear()
                weights = (act_weights if kind == "act" else diffusion_weights)(config, inputs)
                found, modes = self.write(config, weights, inputs, older), config["normalization_mapping"]
                done = self.export("--period", "33 ms")
                self.assertEqual(done.returncode, 0, done.stderr)
                rows, images = self.shown_in_a_run(inputs, config["n_obs_steps"])
                context = [[row["observation_id"], 0, 0, 0, 0] + [0] * 96 if kind == "diffusion" else [] for row in rows]
                said = self.answers([np.concatenate([row["input"], *(images[sha].transpose(2, 0, 1).ravel() / 255 for sha in row["sample_image"]), more])
                                     for row, more in zip(rows, context)])
                for row, answer in zip(rows, said):
                    row["output"] = answer.ravel()
                run = types.SimpleNamespace(folder=self.folder, policy_inputs=types.SimpleNamespace(iterrows=lambda rows=rows: enumerate(rows)), image=images.__getitem__)
                (self.folder / "config.yaml").write_text("sensors:\n  - name: wrist\n  - name: target\n  - name: front\npolicy:\n  sampler:\n    noisy: x_t\n    seed: 1\n")
                command = ["compare", str(self.checkpoint), str(self.folder), *(text for name in JOINTS for text in ("--joint", name))]
                with mock.patch.dict(sys.modules, {"lerobot.policies.factory": None}), self.assertRaisesRegex(takt.Refused, "needs LeRobot and PyTorch: run it with the Python in which"):
                    self.compared(command, run, None)
                policy = stand_in(config, weights, inputs, found, modes, older)
                code, said = self.compared(command, run, self.folder / "robot.onnx")
                self.assertRegex(said, r"^agrees: 2 of 2 answers of .*: largest difference [0-9.]+e-0[5-9] rad \(slide: m\), of joint \w+ at step \d+ of answer \d; tolerance 0.0001\n$")
                self.assertEqual(code, 0)
                rows[1]["output"] = rows[1]["output"] + np.eye(1, rows[1]["output"].size, 8)[0] * 0.5
                rows[0]["output"] = np.where(np.arange(rows[0]["output"].size) == 9, np.nan, rows[0]["output"])
                code, said = self.compared(command, run, None)
                self.assertIn("note: ", said)
                self.assertIn("differs: 2 of 2 answers", said)
                self.assertIn("largest difference inf rad (slide: m), of joint wrist_roll at step 1 of answer 1;", said)
                self.assertEqual(code, 1)
                for attribute, line in (("model" if kind == "act" else "diffusion", "LeRobot cannot answer an observation by .*: TypeError"),
                                        ("config", "LeRobot cannot load .*: AttributeError")):
                    with mock.patch.object(policy, attribute, None), self.assertRaisesRegex(takt.Refused, line if attribute != "diffusion" else "AttributeError"):
                        self.compared(command, run, None)
                if older:
                    kept = policy.normalize_inputs
                    del policy.normalize_inputs
                    with self.assertRaisesRegex(takt.Refused, "let it migrate the folder, and export that"):
                        self.compared(command, run, None)
                    policy.normalize_inputs = kept
                rows[0]["by_client"] = True
                self.assertIn("of joint elbow at step 1 of answer 2;", self.compared(command, run, None)[1])
                rows[1]["sample_image"] = [""] * len(rows[1]["sample_image"])
                if ".images." in str(inputs):
                    with self.assertRaisesRegex(takt.Refused, "has no answer to compare"):
                        self.compared(command, run, None)

    def compared(self, command, run, ran):
        """`ran`: what the run's manifest says its policy was."""
        run.manifest = {"policy": {"sha256": hashlib.sha256(ran.read_bytes()).hexdigest() if ran else ""}}
        said = io.StringIO()
        with mock.patch.object(takt, "open", return_value=run), mock.patch.object(takt, "Run", types.SimpleNamespace), contextlib.redirect_stdout(said):
            return main(command), said.getvalue()

    def shown_in_a_run(self, inputs, history):
        random, rows, images = np.random.RandomState(6), [], {}
        cameras = [name.rpartition(".")[2] for name, (kind, _) in inputs.items() if kind == "VISUAL"]
        for id in (1, 2):
            row = {"sender": "policy", "by_client": False, "observation_id": id, "sample_sensor": [], "sample_image": []}
            row["input"] = np.concatenate([random.uniform(-1, 1, history * shape[0]) for kind, shape in inputs.values() if kind != "VISUAL"]).astype(np.float32)
            for camera in cameras:
                for _ in range(history):
                    images[f"{len(images):064x}"] = random.randint(0, 256, (40, 56, 3)).astype(np.uint8)
                    row["sample_sensor"].append({"wrist": 0, "front": 2}[camera])
                    row["sample_image"].append(f"{len(images) - 1:064x}")
            rows.append(row)
        return rows, images

    def small(self, **changes):
        """A small folder without images; returns its weights."""
        config = ACT | changes
        weights = act_weights(config, STATE | ENVIRONMENT)
        self.write(config, weights, STATE | ENVIRONMENT)
        return weights

    def edit(self, name, change):
        path = self.checkpoint / name
        content = json.loads(path.read_text())
        change(content)
        path.write_text(json.dumps(content))

    def test_the_robot_file_keeps_all_but_its_policy(self):
        self.small()
        done = self.export()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("policy.period 133 ms (n_action_steps 4 at 30 Hz, in whole ms)", done.stdout)
        self.assertIn("lost: config.json: not carried, of training or without effect: device, dropout, kl_weight,", done.stdout)
        self.assertIn("sensor environment_state added: 4 values, in the data set's units", done.stdout)
        old, new = ROBOT.read_text(), (self.folder / "robot.yaml").read_text()
        added = "  - { name: environment_state, values: 4, timeout: 100 ms }\n"
        self.assertEqual(new.count(added), 1)
        policy = r"(?ms)^policy:.*?(?=^sensors:)"
        self.assertEqual(re.sub(policy, "", old).strip(), re.sub(policy, "", new.replace(added, "")).strip())
        check = self.takt("config", "check", "robot.yaml")
        self.assertEqual(check.returncode, 0, check.stderr)
        self.assertIn("fits", self.takt("policy", "check", "robot.onnx", "--robot", "robot.yaml").stdout)

    def test_a_refusal_is_one_line_and_an_exit_code(self):
        environment = {**os.environ, "PYTHONPATH": str(SOURCE / "client/python"), "PYTHONDONTWRITEBYTECODE": "1"}
        for arguments, code, line in (([], 64, "the following arguments are required: --fps, --joint"), (["--fps", "30", "--joint", "a=deg"], 65, "config.json cannot be read")):
            done = subprocess.run(["/usr/bin/python3", "-m", "takt.lerobot", "export", self.folder, "--robot", ROBOT, "--out", self.folder / "robot.yaml", *arguments],
                                  env=environment, capture_output=True, text=True, timeout=120, check=False)
            self.assertEqual((done.returncode, done.stdout, done.stderr.count("\n")), (code, "", 1), done.stderr)
            self.assertIn(line, done.stderr)

    def test_a_robot_file_has_sensors_in_any_of_its_ways(self):
        for before, after in (("", "sensors:\n  - { name: environment_state, values: 4"), ("sensors: []", "sensors:\n  - { name: environment_state, values: 4"),
                              ("sensors:\n- name: environment_state\n  values: 4\n  timeout: 1 s", "sensors:\n- name: environment_state\n  values: 4"),
                              ("sensors:\n    # a camera\n    - { name: cam0, values: 3, timeout: 1 s }", "timeout: 1 s }\n    - { name: environment_state")):
            with self.subTest(before):
                self.clear()
                self.small()
                robot = self.checkpoint / "robot.yaml"
                robot.write_text(f"schema: takt.robot/1\n{before}\npolicy:\n  file: a\n\n# of the rest\nrecord:\n  directory: runs\n")
                done = self.export(robot=robot)
                self.assertEqual(done.returncode, 0, done.stderr)
                text = (self.folder / "robot.yaml").read_text()
                self.assertIn(after, text)
                self.assertEqual(text.count("environment_state, values") + text.count("name: environment_state\n"), 1, text)
                self.assertIn("\n\n# of the rest\nrecord:\n  directory: runs\n", text)
                self.assertNotIn("file: a", text)

    def test_temporal_ensembling_is_the_robot_files(self):
        self.small(temporal_ensemble_coeff=0.01, n_action_steps=1)
        done = self.export()
        self.assertEqual(done.returncode, 0, done.stderr)
        text = (self.folder / "robot.yaml").read_text()
        self.assertIn("join: { kind: ensemble, decay: 0.01 }", text)
        self.assertIn("period: 33 ms", text)
        self.assertEqual(self.takt("config", "check", "robot.yaml").returncode, 0, self.takt("config", "check", "robot.yaml").stderr)

    def test_what_a_checkpoint_does_not_say_is_asked_for(self):
        self.small()
        self.refused("--joint 'elbow' has no unit; write one such as elbow=deg", joints=("elbow",), code=64)
        self.refused("--joint 'elbow=0..0 is 1..2 deg': a range is empty", joints=("elbow=0..0 is 1..2 deg",), code=64)
        self.refused("observation.state has 6 values, and 5 --joint say what they are", joints=JOINTS[:5])
        self.refused("--fps 'fast' is no frequency", fps="fast", code=64)
        self.small(n_action_steps=12)
        self.refused('n_action_steps 12 is the whole chunk: LeRobot stands still while it infers. Say by --period how often to infer, less than 400 ms')

    def test_every_key_is_used_lost_or_refused(self):
        for change, line in (({"type": "pi0"}, "type is pi0; act"), ({"wiggle": 3}, "wiggle is 3, and no such key is known here"), ({"n_obs_steps": 2}, "n_obs_steps is 2"),
                             ({"chunk_size": 1000}, "chunk_size is 1000"), ({"chunk_size": True}, "chunk_size is true"), ({"feedforward_activation": "glu"}, "is glu; there are relu, gelu"),
                             ({"replace_final_stride_with_dilation": True}, "a dilated backbone is not exported"), ({"dim_model": 30}, "dim_model 30 is no multiple of n_heads 4"),
                             ({"dim_model": 64}, "has the shape"), ({"temporal_ensemble_coeff": -0.1}, "temporal_ensemble_coeff is -0.1"), ({"input_features": None}, "input_shapes"),
                             ({"input_features": {"observation.state": {"type": "LANGUAGE", "shape": [6]}}}, "of type LANGUAGE, which no robot file has"),
                             ({"input_features": {"observation.images.a": {"type": "VISUAL", "shape": [480, 640, 3]}}}, "images are 3 channels (RGB), then height and width"),
                             ({"output_features": {"action": {"type": "ACTION", "shape": [6]}, "gripper": {"type": "ACTION", "shape": [1]}}}, "another feature than action")):
            with self.subTest(line):
                self.small()
                self.edit("config.json", lambda content, change=change: content.update(change))
                self.refused(line)
        self.small(wiggle=None, waggle=3)
        done = self.export("--ignore", "waggle")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertRegex(done.stdout, "lost: config.json: .*, waggle, wiggle")

    def test_processors_that_change_numbers_are_refused(self):
        def into(name, step):
            self.small()
            self.edit(f"{name}.json", lambda content: content["steps"].insert(0, step))

        into("policy_postprocessor", {"registry_name": "relative_actions_processor", "config": {}})
        self.refused("step relative_actions_processor changes what the network sees or says")
        into("policy_preprocessor", {"class": "my.Own", "config": {}})
        self.refused("step my.Own changes")
        into("policy_preprocessor", {"registry_name": "device_processor", "config": {"float_dtype": "float16"}})
        self.refused("device_processor computes in float16")
        into("policy_preprocessor", {"registry_name": "normalizer_processor", "config": {}, "state_file": "../model.safetensors"})
        self.refused("normalizer_processor has no state_file in this folder")
        for change, line in (({"norm_map": {"STATE": []}}, "observation.state is normalised by []"), ({"whiten": True}, "has a setting that is unknown here, whiten"),
                             ({"eps": 0}, "eps is 0"), ({"features": []}, "features is []")):
            self.small()
            self.edit("policy_preprocessor.json", lambda content, change=change: content["steps"][3]["config"].update(change))
            self.refused(line)
        self.small()
        self.edit("policy_preprocessor.json", lambda content: content["steps"][3].update(state_file="a\0"))
        self.refused("normalizer_processor has no state_file in this folder")
        self.small()
        (self.checkpoint / "policy_preprocessor.json").unlink()
        self.refused("has no statistics: there are buffers in model.safetensors (older LeRobot), or policy_preprocessor.json")

    def test_processors_count_where_config_json_says_otherwise(self):
        self.small()
        self.edit("policy_preprocessor.json", lambda content: content["steps"].insert(0, {"registry_name": "relative_actions_processor", "config": {"enabled": False}}))
        self.edit("policy_preprocessor.json", lambda content: content["steps"][4]["config"]["features"].pop("observation.environment_state"))
        self.edit("policy_preprocessor.json", lambda content: content["steps"][4]["config"].update(norm_map=dict(MODES, STATE="MIN_MAX")))
        done = self.export()
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("lost: observation.environment_state: policy_preprocessor.json does not list it; it is not normalised, as in LeRobot\n", done.stdout)
        self.assertIn("lost: config.json: normalization_mapping differs from policy_preprocessor.json, which counts, as in LeRobot\n", done.stdout)
        self.clear()
        self.small()
        self.edit("policy_preprocessor.json", lambda content: content["steps"][0]["config"].update(rename_map={"observation.scene": "observation.environment_state"}))
        self.assertIn("sensor scene added: 4 values", self.export().stdout)

    # Threat: policy-checkpoint
    def test_a_strangers_weights_are_bounded_and_wholly_accounted_for(self):
        def with_weights(change):
            weights = self.small()
            change(weights)
            safetensors(self.checkpoint / "model.safetensors", weights)

        def spoil(weights):
            weights["model.action_head.bias"][2] = np.nan

        with_weights(spoil)
        self.refused("model.action_head.bias has values that are not finite")
        with_weights(lambda weights: weights.pop("model.decoder.norm.weight"))
        self.refused("has no tensor model.decoder.norm.weight, which config.json asks for")
        with_weights(lambda weights: weights.update({"model.camera_id_embed.weight": np.zeros((2, 32), np.float32)}))
        self.refused("1 tensors, model.camera_id_embed.weight among them, belong to no part of the network")
        self.small()
        path = self.checkpoint / "model.safetensors"
        content = path.read_bytes()
        size = int.from_bytes(content[:8], "little")
        first = re.search(rb'"data_offsets": \[0, (\d+)\]', content)
        for spoilt, line in ((b"", "cannot be read|not a safetensors file"), (b"\xff" * 8 + content[8:], "its header does not fit"), (content[:8 + size // 2], "does not fit"),
                             (content[:8] + b"[" * size + content[8 + size:], "its header is not JSON"), (content[:-4], "beyond the file"),
                             (content.replace(first[0], first[0].replace(b"[0, ", b"[4, ")), "bytes, and its shape"), (content.replace(b'"F32"', b'"F8X"', 1), "is of type F8X"),
                             (content.replace(b'"F32"', b'[333]', 1), "is of type")):
            path.write_bytes(spoilt)
            done = self.export()
            self.assertEqual(done.returncode, 65, done.stdout + done.stderr)
            self.assertEqual(done.stderr.count("\n"), 1, done.stderr)
            self.assertRegex(done.stderr, line)
        path.write_bytes((5 << 20).to_bytes(8, "little") + b" " * (6 << 20))
        self.refused("its header does not fit")
        path.unlink()
        (self.checkpoint / "pytorch_model.bin").write_bytes(b"\x80\x04cposix\nsystem\n.")
        self.refused("model.safetensors cannot be read: No such file or directory")
        os.mkfifo(path)
        self.refused("model.safetensors cannot be read: it is not a regular file")
        (self.checkpoint / "config.json").write_text("[" + " " * (5 << 20) + "]")
        self.refused("config.json is larger than 4 MiB")
        (self.checkpoint / "config.json").write_text("[" * 100000)
        self.refused("config.json cannot be read: it is nested too deeply")

    def test_nothing_is_overwritten_or_half_written(self):
        self.small()
        (self.checkpoint / "robot.onnx").write_text("mine")
        done = self.export(out="checkpoint/robot.yaml")
        self.assertEqual((done.returncode, done.stderr.strip()), (1, f"{self.checkpoint}/robot.onnx exists already; choose another --out"))
        self.assertEqual((self.checkpoint / "robot.onnx").read_text(), "mine")
        self.refused("cannot be written: No such file or directory", out="nowhere/robot.yaml", code=1)
        self.refused("is not a robot file", robot=self.checkpoint / "config.json")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
