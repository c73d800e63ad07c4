# SPDX-License-Identifier: Apache-2.0
"""What LeRobot itself says to the observations of a run, beside what Takt's policy host said: LeRobot's own classes in PyTorch are the judge."""
import importlib
import math
import re
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

import numpy as np

from takt import _files, _samples
from takt._refused import Refused
from takt._run import Run
from takt.lerobot._checkpoint import Checkpoint, shown
from takt.lerobot._graph import Array
from takt.lerobot._units import Joint, to_data, to_robot

Tensors = Dict[str, Any]


class Apart(NamedTuple):
    """The largest difference of a target, rad (slide: m), and where; how many answers were compared, and how many the run has."""

    largest: float
    answer: int
    step: int
    joint: str
    compared: int
    answers: int


def _line(error: Exception) -> str:
    return f"{type(error).__name__}: {shown(str(error).strip().partition(chr(10))[0])}"


def _module(name: str) -> Any:
    for package in ("lerobot", "lerobot.common"):
        try:
            return importlib.import_module(f"{package}.{name}")
        except ImportError:
            continue
    raise Refused("takt.lerobot compare needs LeRobot and PyTorch: run it with the Python in which the policy was trained")


class _Judge:
    """A policy of LeRobot's, on the processor, and its normalisation: inside it (older), or by processors (newer)."""

    def __init__(self, checkpoint: Checkpoint) -> None:
        factory, self._torch = _module("policies.factory"), importlib.import_module("torch")
        folder = str(checkpoint.folder)
        try:
            self._policy = factory.get_policy_class(checkpoint.kind).from_pretrained(folder).to("cpu").eval()
            self._policy.config.device = "cpu"
            self._before: Callable[[Tensors], Tensors] = lambda batch: dict(self._policy.normalize_inputs({name: one[None] for name, one in batch.items()}))
            self._after: Callable[[Any], Any] = lambda action: self._policy.unnormalize_outputs({"action": action})["action"]
            if (checkpoint.folder / "policy_preprocessor.json").exists():
                on_processor = {"device_processor": {"device": "cpu"}}
                self._before, self._after = factory.make_pre_post_processors(self._policy.config, pretrained_path=folder, preprocessor_overrides=on_processor,
                                                                             postprocessor_overrides=on_processor)
        except Exception as error:  # whatever LeRobot raises
            raise Refused(f"LeRobot cannot load {folder}: {_line(error)}") from None
        if not (checkpoint.folder / "policy_preprocessor.json").exists() and not hasattr(self._policy, "normalize_inputs"):
            raise Refused(f"{folder} has the statistics of an older LeRobot among its weights, which the installed one does not read: let it migrate the folder, and export that")
        self._images, self._checkpoint = [one.name for one in checkpoint.of_kind("VISUAL")], checkpoint

    def says(self, instants: List[Tensors], noise: Array) -> Array:
        """(steps, joints), in the data set's units, from the newest of the instants on. `noise`: (horizon, joints) of a diffusion policy, from the oldest."""
        try:
            return self._said(instants, noise)
        except Exception as error:  # whatever LeRobot raises
            raise Refused(f"LeRobot cannot answer an observation by {self._checkpoint.folder}: {_line(error)}", 1) from None

    def _said(self, instants: List[Tensors], noise: Array) -> Array:
        torch = self._torch
        with torch.inference_mode():
            shown_ = [self._before({name: torch.from_numpy(np.array(values, np.float32)) for name, values in one.items()}) for one in instants]
            names = list(instants[0])
            if self._checkpoint.kind == "act":
                batch = {name: shown_[0][name] for name in names}
                if self._images:
                    batch["observation.images"] = [batch[name] for name in self._images]
                said = self._policy.model(batch)[0]
            else:
                batch = {name: torch.stack([one[name] for one in shown_], dim=1) for name in names}
                if self._images:
                    batch["observation.images"] = torch.stack([batch[name] for name in self._images], dim=-4)
                said = self._denoised(batch, torch.from_numpy(noise)[None])[:, len(instants) - 1:]
            steps = [self._after(said[:, step]) for step in range(said.shape[1])]
            return np.array(torch.cat(steps).cpu().numpy(), np.float64)

    def _denoised(self, batch: Tensors, x: Any) -> Any:
        model, torch, steps = self._policy.diffusion, self._torch, self._checkpoint.integer("num_inference_steps", 1, 10000)
        if type(model.noise_scheduler).__name__ == "DDPMScheduler":
            schedulers = importlib.import_module("diffusers.schedulers.scheduling_ddim")
            model.noise_scheduler = schedulers.DDIMScheduler.from_config(model.noise_scheduler.config)
        condition = model._prepare_global_conditioning(batch)
        model.noise_scheduler.set_timesteps(steps)
        for time in model.noise_scheduler.timesteps:
            said = model.unet(x, torch.full(x.shape[:1], int(time), dtype=torch.long), global_cond=condition)
            x = model.noise_scheduler.step(said, time, x).prev_sample
        return x


def _noise(seed: int, observation: int, count: int) -> Array:
    """What Takt's sampler draws: a counter mixed by splitmix64's constants, and Box and Muller's normal numbers of it."""
    whole = (1 << 64) - 1

    def mixed(value: int) -> int:
        value = (value + 0x9E3779B97F4A7C15) & whole
        value = ((value ^ (value >> 30)) * 0xBF58476D1CE4E5B9) & whole
        value = ((value ^ (value >> 27)) * 0x94D049BB133111EB) & whole
        return value ^ (value >> 31)

    state, drawn = mixed(mixed(mixed(seed) ^ observation)), []
    for pair in range((count + 1) // 2):
        radius, angle = ((mixed((state + 2 * pair + i) & whole) >> 11) * 2.0**-53 for i in range(2))
        radius = math.sqrt(-2 * math.log(1 - radius))
        drawn += [radius * math.cos(2 * math.pi * angle), radius * math.sin(2 * math.pi * angle)]
    return np.array(drawn[:count], np.float32)


def _instants(run: Run, row: Any, checkpoint: Checkpoint, joints: List[Joint], sensors: Dict[str, int], history: int) -> List[Tensors]:
    """What the network was shown, oldest first, in the data set's units; empty where an image has no file."""
    instants: List[Tensors] = [{} for _ in range(history)]
    values, data = np.asarray(row["input"], np.float64), to_data(joints)
    for kind in ("STATE", "ENV"):
        for feature in checkpoint.of_kind(kind):
            of_feature, values = np.split(values, [history * feature.shape[0]])
            for instant, part in zip(instants, of_feature.reshape(history, -1)):
                instant[feature.name] = data.gain * part + data.shift if kind == "STATE" else part
    for feature in checkpoint.of_kind("VISUAL"):
        images = [sha for sensor, sha in zip(row["sample_sensor"], row["sample_image"]) if int(sensor) == sensors[feature.name]]
        if len(images) != history or not all(images):
            return []
        for instant, sha in zip(instants, images):
            try:
                instant[feature.name] = run.image(sha).transpose(2, 0, 1) / np.float32(255)
            except Refused:
                return []
    return instants


def compare(checkpoint: Checkpoint, joints: List[Joint], run: Run, sensor_of: Callable[[str], str], most: int) -> Apart:
    """`sensor_of`: a feature's sensor. `most` answers are compared, evenly spread over the run."""
    names, _, _ = _samples.declared(run.folder / "config.yaml")
    sensors = {one.name: names.index(sensor_of(one.name)) if sensor_of(one.name) in names else -1 for one in checkpoint.of_kind("VISUAL")}
    diffuses, count = checkpoint.kind == "diffusion", checkpoint.action.shape[0]
    history = checkpoint.integer("n_obs_steps", 1, 16)
    steps = checkpoint.integer("horizon" if diffuses else "chunk_size", 1, 128)
    seed = re.search(r"^  sampler:\n(?:    .*\n)*?    seed: (\d+)", _files.text_of(run.folder / "config.yaml"), re.MULTILINE)
    found = [row for _, row in run.policy_inputs.iterrows() if row["sender"] == "policy" and not row["by_client"] and len(row["output"]) == steps * count]
    chosen = [found[index] for index in sorted({round(index) for index in np.linspace(0, len(found) - 1, most)})] if found else []
    judge, robot, normal, worst, compared = _Judge(checkpoint), to_robot(joints), checkpoint.normal["action"], Apart(-1.0, 0, 0, "", 0, 0), 0
    for row in chosen:
        instants, id = _instants(run, row, checkpoint, joints, sensors, history), int(row["observation_id"])
        if not instants:
            continue
        noise = _noise(int(seed[1]) if seed else 1, id, steps * count).reshape(steps, count) if diffuses else np.empty(0)
        wanted = robot.gain * judge.says(instants, np.roll(noise, history - 1, axis=0)) + robot.shift
        said = np.asarray(row["output"], np.float64).reshape(steps, count)
        said = normal.gain * said + normal.shift if diffuses else said
        apart = np.nan_to_num(abs(said[:len(wanted)] - wanted), nan=math.inf)
        step, joint = np.unravel_index(int(apart.argmax()), apart.shape)
        largest = float(apart[step, joint])
        compared += 1
        if largest > worst.largest:
            worst = Apart(largest, id, int(step), joints[joint].name, 0, 0)
    if not compared:
        raise Refused(f"{run.folder} has no answer to compare: `record.policy_inputs` and `record.images` must be on, and its policy this folder's export", 1)
    return worst._replace(compared=compared, answers=len(found))
