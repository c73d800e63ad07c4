# SPDX-License-Identifier: Apache-2.0
"""A checkpoint folder of LeRobot: config.json, model.safetensors, and the statistics of its normalisation, which older folders keep among the weights and
newer ones in the files of policy_preprocessor.json and policy_postprocessor.json. The folder is a stranger's: no pickle, no code, every size bounded.
"""
import hashlib
import json
import math
import pathlib
from dataclasses import dataclass, field
from typing import Any, Dict, Iterable, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np
from numpy.typing import NDArray

from takt import _files
from takt._refused import Refused

_LARGEST_TEXT = 4 << 20  # bytes of JSON, or of a header's names and shapes
_MOST_PIXELS, _MOST_CAMERAS, _MOST_VALUES = 4096, 16, 256
_BYTES = {"F64": 8, "F32": 4, "F16": 2, "BF16": 2, "I64": 8}
_STATISTICS = {"MEAN_STD": ("mean", "std"), "MIN_MAX": ("min", "max"), "QUANTILES": ("q01", "q99"), "QUANTILE10": ("q10", "q90"), "IDENTITY": ()}
# Steps of a processor that leave every number as it is.
_HARMLESS = ("to_batch_processor", "device_processor")

Array = NDArray[Any]


class Tensors:
    """A safetensors file. Every tensor is read when it is taken, checked for its shape and for values that are not finite."""

    def __init__(self, path: pathlib.Path) -> None:
        self.path = path
        self._data = _files.mapped(path)
        size = int.from_bytes(self._data[:8], "little")
        if len(self._data) < 8 or size > min(_LARGEST_TEXT, len(self._data) - 8):
            raise Refused(f"{path} is not a safetensors file: its header does not fit into it")
        try:
            header = json.loads(bytes(self._data[8:8 + size]))
        except (ValueError, RecursionError):
            raise Refused(f"{path} is not a safetensors file: its header is not JSON") from None
        self._body = self._data[8 + size:]
        self._entries: Dict[str, Tuple[str, Tuple[int, ...], int, int]] = {}
        if not isinstance(header, dict):
            raise Refused(f"{path} is not a safetensors file: its header is not a table of tensors")
        end = 0
        entries = [(name, self._entry(name, entry)) for name, entry in header.items() if name != "__metadata__"]
        for name, (kind, shape, begin, after) in sorted(entries, key=lambda one: one[1][2:]):
            if begin != end or after > len(self._body):
                raise Refused(f"{path}: {shown(name)} lies at bytes {begin} to {after}, which overlap others, leave a gap, or are beyond the file")
            end = after
            self._entries[name] = (kind, shape, begin, after)
        self._left = set(self._entries)

    def _entry(self, name: str, entry: Any) -> Tuple[str, Tuple[int, ...], int, int]:
        try:
            kind, shape, (begin, end) = entry["dtype"], tuple(entry["shape"]), entry["data_offsets"]
            whole = all(type(one) is int and one >= 0 for one in (*shape, begin, end))
        except (TypeError, KeyError, ValueError):
            whole = False
        if not whole:
            raise Refused(f"{self.path}: {shown(name)} has no dtype, shape and data_offsets as safetensors files have them")
        if not isinstance(kind, str) or kind not in _BYTES:
            raise Refused(f"{self.path}: {shown(name)} is of type {shown(kind)}; convert the checkpoint to float32")
        if len(shape) > 8 or math.prod(shape) * _BYTES[kind] != end - begin:
            raise Refused(f"{self.path}: {shown(name)} has {end - begin} bytes, and its shape {list(shape)} needs another number of them")
        return kind, shape, begin, end

    def __contains__(self, name: str) -> bool:
        return name in self._entries

    def names(self) -> Iterable[str]:
        return self._entries

    def sha256(self) -> str:
        return hashlib.sha256(self._data).hexdigest()

    def take(self, name: str, *shape: int) -> Array:
        """float64. Refused where the tensor is missing, of another shape (none given: any), or not finite."""
        if name not in self._entries:
            raise Refused(f"{self.path} has no tensor {name}, which config.json asks for")
        kind, found, begin, end = self._entries[name]
        if shape and found != shape:
            raise Refused(f"{self.path}: {name} has the shape {list(found)}, and config.json asks for {list(shape)}")
        raw = self._body[begin:end]
        if kind == "BF16":
            values = (np.frombuffer(raw, "<u2").astype(np.uint32) << 16).view(np.float32).astype(np.float64)
        else:
            values = np.frombuffer(raw, {"F64": "<f8", "F32": "<f4", "F16": "<f2", "I64": "<i8"}[kind]).astype(np.float64)
        if not np.isfinite(values).all():
            raise Refused(f"{self.path}: {name} has values that are not finite (NaN or infinity); train or save it again")
        self._left.discard(name)
        return values.reshape(found)

    def drop(self, *beginnings: str) -> int:
        """How many tensors so named were left; they are done with."""
        gone = {name for name in self._left if name.startswith(beginnings)}
        self._left -= gone
        return len(gone)

    def refuse_rest(self) -> None:
        if self._left:
            raise Refused(f"{self.path}: {len(self._left)} tensors, {shown(min(self._left))} among them, belong to no part of the network that "
                          "config.json describes; this network is another than LeRobot's, and cannot be exported")


class Affine(NamedTuple):
    """gain * x + shift, float64, one value per dimension, or per channel."""

    gain: Array
    shift: Array

    def after(self, first: "Affine") -> "Affine":
        return Affine(self.gain * first.gain, self.gain * first.shift + self.shift)


class Feature(NamedTuple):
    name: str  # LeRobot's key
    kind: str  # STATE, ENV, VISUAL or ACTION
    shape: Tuple[int, ...]


@dataclass
class Checkpoint:
    """`lost`: what no file of Takt's carries, one line each. `normal`: per feature, towards the network; of "action", from it."""

    folder: pathlib.Path
    kind: str
    config: Mapping[str, Any]
    weights: Tensors
    sha256: str
    inputs: List[Feature]
    action: Feature
    normal: Dict[str, Affine] = field(default_factory=dict)
    recorded: Dict[str, str] = field(default_factory=dict)  # of a feature's name the one that the robot gave it
    lost: List[str] = field(default_factory=list)

    def of_kind(self, kind: str) -> List[Feature]:
        return [one for one in self.inputs if one.kind == kind]

    def integer(self, key: str, lowest: int, highest: int) -> int:
        value = self.config.get(key)
        if type(value) is not int or not lowest <= value <= highest:
            raise Refused(f"{self.folder}/config.json: {key} is {shown(value)}, and it must be a whole number from {lowest} to {highest}")
        return value

    def flag(self, key: str) -> bool:
        value = self.config.get(key)
        if value not in (True, False):
            raise Refused(f"{self.folder}/config.json: {key} is {shown(value)}, and it must be true or false")
        return bool(value)

    def number(self, key: str, lowest: float, highest: float) -> float:
        value = self.config.get(key)
        if type(value) not in (int, float) or not lowest <= float(value) <= highest:  # type: ignore[arg-type]
            raise Refused(f"{self.folder}/config.json: {key} is {shown(value)}, and it must be a number from {lowest:g} to {highest:g}")
        return float(value)  # type: ignore[arg-type]

    def choice(self, key: str, allowed: Sequence[str]) -> str:
        value = self.config.get(key)
        if value not in allowed:
            raise Refused(f"{self.folder}/config.json: {key} is {shown(value)}; there are {', '.join(allowed)}")
        return str(value)

    def refuse(self, key: str, why: str) -> None:
        """`key` must be null, false or absent."""
        if self.config.get(key):
            raise Refused(f"{self.folder}/config.json: {key} is {shown(self.config[key])}: {why}")


def shown(value: Any) -> str:
    """What a stranger wrote, for one line."""
    text = value if isinstance(value, str) else json.dumps(value)
    return "".join(c if c.isprintable() else "?" for c in text[:60]) + ("..." if len(text) > 60 else "")


def _table(path: pathlib.Path) -> Dict[str, Any]:
    if len(_files.mapped(path)) > _LARGEST_TEXT:
        raise Refused(f"{path} is larger than {_LARGEST_TEXT >> 20} MiB")
    found = _files.json_of(path)
    if not isinstance(found, dict):
        raise Refused(f"{path} is not a table of keys, as LeRobot writes it")
    return found


def _features(path: pathlib.Path, key: str, found: Any) -> List[Feature]:
    features = []
    if not isinstance(found, dict) or not found:
        raise Refused(f"{path}: {key} lists no feature; a folder saved before LeRobot 0.2 (input_shapes) must be loaded and saved by a newer one")
    for name, entry in found.items():
        kind, shape = (entry.get("type"), entry.get("shape")) if isinstance(entry, dict) else (None, None)
        if not isinstance(shape, list) or not all(type(one) is int and one > 0 for one in shape) or not isinstance(kind, str):
            raise Refused(f"{path}: {key}.{shown(name)} has no type and shape")
        if not all(c.isascii() and (c.isalnum() or c in "_-./") for c in name):
            raise Refused(f"{path}: {shown(name)} cannot name a tensor; rename the feature with letters, digits and _ - . /")
        sizes = {"STATE": 1, "ENV": 1, "ACTION": 1, "VISUAL": 3}
        if kind not in sizes:
            raise Refused(f"{path}: {key}.{name} is of type {shown(kind)}, which no robot file has; there are {', '.join(sizes)}")
        if len(shape) != sizes[kind] or (kind != "VISUAL" and shape[0] > _MOST_VALUES):
            raise Refused(f"{path}: {key}.{name} has the shape {shape}; {kind} has {sizes[kind]} dimensions, and at most {_MOST_VALUES} values")
        if kind == "VISUAL" and (shape[0] != 3 or max(shape) > _MOST_PIXELS):
            raise Refused(f"{path}: {key}.{name} has the shape {shape}; images are 3 channels (RGB), then height and width up to {_MOST_PIXELS}")
        features.append(Feature(name, kind, tuple(shape)))
    return features


def _spread(checkpoint: Checkpoint, feature: Feature, mode: str, low: Array, high: Array, epsilon: float, by_buffers: bool) -> Affine:
    """What LeRobot computes from two statistics, as gain and shift."""
    if mode == "MEAN_STD":
        return Affine(high, low) if feature.kind == "ACTION" else Affine(1 / (high + epsilon), -low / (high + epsilon))
    # The older layout adds epsilon to every range, and not on the way back; the newer one puts it in the place of an empty range.
    wide = high - low
    if not by_buffers:
        wide = np.where(wide == 0, epsilon, wide)
    if feature.kind == "ACTION":
        return Affine(wide / 2, wide / 2 + low)
    wide = wide + (epsilon if by_buffers else 0)
    if (wide == 0).any():
        raise Refused(f"{checkpoint.folder}: the statistics of {feature.name} span nothing")
    return Affine(2 / wide, -2 * low / wide - 1)


def _normalisation(checkpoint: Checkpoint, features: Iterable[Feature], modes: Any, tensors: Tensors, beginning: str, epsilon: float, by_buffers: bool) -> None:
    for feature in features:
        mode = modes.get(feature.kind, "IDENTITY") if isinstance(modes, dict) else None
        if not isinstance(mode, str) or mode not in _STATISTICS:
            raise Refused(f"{checkpoint.folder}: {feature.name} is normalised by {shown(mode)}; there are {', '.join(_STATISTICS)}")
        width = feature.shape[0]
        checkpoint.normal[feature.name] = Affine(np.ones(width), np.zeros(width))
        if mode == "IDENTITY":
            continue
        key = (feature.name.replace(".", "_") if by_buffers else feature.name) + "."
        names = [beginning + key + statistic for statistic in _STATISTICS[mode]]
        if not by_buffers and not any(name in tensors for name in names):
            checkpoint.lost.append(f"{feature.name}: {tensors.path.name} has no statistics of it; it is not normalised, as in LeRobot")
            continue
        low, high = (tensors.take(name).reshape(-1) for name in names)
        if low.shape != (width,) or high.shape != (width,):
            raise Refused(f"{tensors.path}: {names[0]} has {low.size} values, and {feature.name} has {width}")
        checkpoint.normal[feature.name] = _spread(checkpoint, feature, mode, low, high, epsilon, by_buffers)


def _step(path: pathlib.Path, step: Any, kind: str) -> Optional[Mapping[str, Any]]:
    """The settings of a step, where it is the one that normalises."""
    name = step.get("registry_name", step.get("class")) if isinstance(step, dict) else None
    settings = step.get("config", {}) if isinstance(step, dict) else None
    if not isinstance(name, str) or not isinstance(settings, dict):
        raise Refused(f"{path}: a step has no registry_name and config")
    if name == kind:
        unknown = [key for key, value in settings.items() if key not in ("eps", "features", "norm_map", "normalize_observation_keys") and value is not None]
        if unknown:
            raise Refused(f"{path}: {kind} has a setting that is unknown here, {shown(unknown[0])}")
        return settings
    if settings.get("enabled") is False:
        return None
    if name == "device_processor" and settings.get("float_dtype") not in (None, "float32"):
        raise Refused(f"{path}: {name} computes in {shown(settings['float_dtype'])}; Takt computes in float32: set float_dtype to null")
    if name not in _HARMLESS:
        raise Refused(f"{path}: step {shown(name)} changes what the network sees or says, and the file cannot carry it; "
                      "train or save the policy without it")
    return None


def _processor(checkpoint: Checkpoint, name: str, kind: str, features: List[Feature]) -> None:
    path = checkpoint.folder / f"{name}.json"
    steps = _table(path).get("steps")
    if not isinstance(steps, list) or len(steps) > 64:
        raise Refused(f"{path} lists no steps")
    found = False
    for step in steps:
        if isinstance(step, dict) and step.get("registry_name") == "rename_observations_processor":
            renamed = step.get("config", {}).get("rename_map", {}) if isinstance(step.get("config", {}), dict) else None
            if not isinstance(renamed, dict) or not all(isinstance(one, str) for one in (*renamed, *renamed.values())) or found:
                raise Refused(f"{path}: rename_observations_processor has no rename_map before the normalisation")
            checkpoint.recorded.update({new: old for old, new in renamed.items()})
            continue
        settings = _step(path, step, kind)
        if settings is None:
            continue
        state = step.get("state_file")
        if found or not isinstance(state, str) or not state.isprintable() or pathlib.PurePath(state).name != state:
            raise Refused(f"{path}: {kind} has no state_file in this folder, or stands there twice")
        found = True
        epsilon = settings.get("eps", 1e-8)
        if type(epsilon) not in (int, float) or not 0 < epsilon < 1:
            raise Refused(f"{path}: eps is {shown(epsilon)}")
        only, listed = settings.get("normalize_observation_keys"), settings.get("features", {one.name: {} for one in features})
        if not isinstance(only, (list, type(None))) or not isinstance(listed, dict):
            raise Refused(f"{path}: normalize_observation_keys is {shown(only)}, and features is {shown(listed)}")
        chosen = [one for one in features if one.kind == "ACTION" or (one.name in listed and (only is None or one.name in only))]
        for one in features:
            if one not in chosen:
                checkpoint.normal[one.name] = Affine(np.ones(one.shape[0]), np.zeros(one.shape[0]))
                checkpoint.lost.append(f"{one.name}: {path.name} does not list it; it is not normalised, as in LeRobot")
        ours = checkpoint.config.get("normalization_mapping")
        modes = settings.get("norm_map", ours)
        if isinstance(ours, dict) and isinstance(modes, dict) and any(modes.get(one.kind) != ours.get(one.kind) for one in chosen):
            checkpoint.lost.append(f"config.json: normalization_mapping differs from {path.name}, which counts, as in LeRobot")
        _normalisation(checkpoint, chosen, modes, Tensors(checkpoint.folder / state), "", float(epsilon), False)
    if not found:
        raise Refused(f"{path} has no step {kind}")


def read(folder: pathlib.Path) -> Checkpoint:
    """Refused in one line where the folder is not one of ACT's or diffusion's."""
    path = folder / "config.json"
    config = _table(path)
    kind = config.get("type")
    if kind not in ("act", "diffusion"):
        raise Refused(f"{path}: type is {shown(kind)}; act and diffusion can be exported. Other policies: docs/python-policy.md, On a server")
    inputs = _features(path, "input_features", config.get("input_features"))
    outputs = _features(path, "output_features", config.get("output_features"))
    if len(outputs) != 1 or outputs[0][:2] != ("action", "ACTION"):
        raise Refused(f"{path}: output_features has another feature than action; the network's output is the joints' targets alone")
    if len([one for one in inputs if one.kind == "VISUAL"]) > _MOST_CAMERAS:
        raise Refused(f"{path}: input_features has more than {_MOST_CAMERAS} images")
    if len([one for one in inputs if one.kind == "ENV"]) > 1 or any(one.kind == "ACTION" for one in inputs):
        raise Refused(f"{path}: input_features has an action, or more than one ENV")
    weights = Tensors(folder / "model.safetensors")
    checkpoint = Checkpoint(folder, kind, config, weights, weights.sha256(), inputs, outputs[0])
    for one in [one for one in inputs if one.kind == "STATE" and one.name != "observation.state"]:
        checkpoint.lost.append(f"{one.name}: LeRobot's network does not read it")
        inputs.remove(one)
    buffers = any(name.startswith("normalize_inputs.") for name in weights.names())
    processors = (folder / "policy_preprocessor.json").exists()
    if buffers == processors:
        raise Refused(f"{folder} has {'two sets of' if buffers else 'no'} statistics: there are buffers in model.safetensors (older LeRobot), "
                      "or policy_preprocessor.json and policy_postprocessor.json with their files (newer)")
    if buffers:
        modes = config.get("normalization_mapping")
        _normalisation(checkpoint, inputs, modes, weights, "normalize_inputs.buffer_", 1e-8, True)
        _normalisation(checkpoint, outputs, modes, weights, "unnormalize_outputs.buffer_", 1e-8, True)
        weights.drop("normalize_inputs.", "normalize_targets.", "unnormalize_outputs.")
    else:
        _processor(checkpoint, "policy_preprocessor", "normalizer_processor", inputs)
        _processor(checkpoint, "policy_postprocessor", "unnormalizer_processor", outputs)
    return checkpoint
