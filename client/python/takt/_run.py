# SPDX-License-Identifier: Apache-2.0
"""What a run or a panel left behind, as tables."""
import functools
import hashlib
import json
import os
import pathlib
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from takt import _files, _mcap, _samples
from takt._refused import Refused

if TYPE_CHECKING:
    import pandas

# What is computed of a drive's feedback, and 0 in the record before there is one.
_OF_FEEDBACK = {"feedback_q", "feedback_dq", "feedback_tau", "feedback_temperature", "feedback_casing", "q_estimate", "dq_estimate", "q_reference", "dq_reference",
                "tau_gravity"}
_AGE_PARTS = ("age_sense", "age_queue", "age_infer", "age_publish", "age_hold")
_SENDERS = {1: "policy", 2: "fallback", 3: "candidate"}
_IMAGE_KEY = ("sensor", "sequence", "sensed_at", "published_at")
_COMMAND_FIELDS = {"q": 1, "dq": 2, "kp": 4, "kd": 8, "tau": 16}


def _pandas() -> Any:
    try:
        import pandas
    except ImportError:
        raise Refused("takt: tables need the Python module pandas: sudo apt install python3-pandas (tick_array does without)") from None
    return pandas


def _lines(path: pathlib.Path) -> List[Any]:
    """A line that a power failure cut off is left out."""
    lines = []
    for line in _files.text_of(path).splitlines():
        try:
            lines.append(json.loads(line))
        except (ValueError, RecursionError):
            break
    return lines


class Run:
    """A run folder. Tables are read when they are first asked for, and kept.

    Times are ns of CLOCK_MONOTONIC (`s`: seconds since the first tick); angles rad, speeds rad/s, torques Nm, gains Nm/rad and Nms/rad;
    of a slide m, m/s, N, N/m and Ns/m.
    """

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder
        self.manifest: Mapping[str, Any] = _files.json_of(folder / "manifest.json")
        self.joints: Tuple[str, ...] = tuple(self.manifest["joints"])
        self.buses: Tuple[str, ...] = tuple(self.manifest["buses"])

    def __repr__(self) -> str:
        return f"takt.Run({str(self.folder)!r})"

    @property
    def metrics(self) -> Mapping[str, Any]:
        """The numbers of the report: metrics.json."""
        metrics: Mapping[str, Any] = _files.json_of(self.folder / "metrics.json")
        return metrics

    @functools.cached_property
    def tick_array(self) -> NDArray[Any]:
        """Every recorded tick, as a structured array with the fields of takt_msgs/msg/Tick; a field of each joint has the shape (ticks, joints)."""
        return _mcap.table(self._recording.fields["/takt/tick"], self._recording.bodies["/takt/tick"])

    @property
    def damaged_chunks(self) -> int:
        """Parts of ticks.mcap that are not what was recorded, or claim more than their bytes can hold: they are left out of every table."""
        return self._recording.damaged

    @functools.cached_property
    def enumerations(self) -> Mapping[str, Mapping[int, str]]:
        """Names of the values of those of a tick's fields that have some: {"mode": {0: "standby", ...}, ...}."""
        return {field.name: field.names for field in self._recording.fields["/takt/tick"] if field.names}

    @functools.cached_property
    def about(self) -> Mapping[str, str]:
        """What each column of `ticks` is, and its unit: {"q_estimate": "output; rad, of a slide m", ...}. "input": the tick read it; "output": it decided or computed it."""
        own = {"s": "since the first tick; s", "age_ms": "of the command that the tick relied on, all parts of it together, 0 while freshness is missing; ms"}
        return own | {field.name: field.about for field in self._recording.fields["/takt/tick"]}

    @functools.cached_property
    def ticks(self) -> "pandas.DataFrame":
        """Every recorded tick. Enumerations by name; a column of each joint and each bus for what they have one by one, as "q_estimate.elbow"
        and "bus_state.can0"; `age_ms`: of the command that the tick relied on, all parts of it together. What rests on a drive that was
        not heard yet is NaN (`tick_array`: 0).
        """
        pandas, found = _pandas(), self.tick_array
        columns: Dict[str, Any] = {"s": (found["now"] - found["now"][:1]) * 1e-9, "age_ms": sum(found[part] for part in _AGE_PARTS) * 1e-6}
        for field in self._recording.fields["/takt/tick"]:
            values = found[field.name]
            if field.count == 1:
                columns[field.name] = self._named(field, values)
                continue
            owners = self.buses if field.name.startswith("bus_") else self.joints
            for index, owner in enumerate(owners[:values.shape[1]]):
                column = self._named(field, values[:, index])
                if field.name in _OF_FEEDBACK:
                    column = np.where(found["feedback_received_at"][:, index] == 0, np.nan, column)
                columns[f"{field.name}.{owner}"] = column
        return pandas.DataFrame(columns)

    @functools.cached_property
    def commands(self) -> "pandas.DataFrame":
        """Every message of a policy. `q`, `dq`, `kp`, `kd`, `tau`: arrays of the shape (steps, joints), None where the message has none or was refused and
        only its header was kept; `sender`: "policy" (in charge), "fallback" or "candidate" (beside it). `tick` is the tick that read it, whose `arrival`
        (`fallback_arrival`, `candidate_arrival`) is the verdict.
        """
        messages = _mcap.rows(self._recording.fields.get("/takt/command", []), self._recording.bodies.get("/takt/command", []))
        for message in messages:
            message["sender"] = _SENDERS[message["sender"]]
            values, shape = message.pop("values"), (message["step_count"], message["joint_count"])
            carried = [name for name, bit in _COMMAND_FIELDS.items() if message["fields"] & bit]
            whole = len(values) == shape[0] * shape[1] * len(carried)
            by_field = values.reshape(shape[0], len(carried), shape[1]) if whole and carried else None
            for name in _COMMAND_FIELDS:
                message[name] = by_field[:, carried.index(name)] if by_field is not None and name in carried else None
            for name in ("fields", "reserved", "rest"):
                del message[name]
        return _pandas().DataFrame(messages)

    @functools.cached_property
    def policy_inputs(self) -> "pandas.DataFrame":
        """What the policy was shown for each of its answers, and what its network said: claims of the policy's process. `observation_id` and `sequence` name
        the command in `commands`. `q` (rad), `dq` (rad/s), `tau` (Nm), `q_setpoint` (rad), `dq_of_drive` (rad/s): of the joints in the answered observation,
        as far as they were shown; `following`, `committed_from`, `committed_count`: which steps of which command were promised. `sample_values`: one array for
        each sample of an outside sensor that was shown, SI units, beside `sample_sensor` (place in the robot file's `sensors`) and its stamps; `sample_image`:
        of each the SHA-256 of the image, "" where it is none, or one that the recorder never had. Of a policy host: `input`, the network's input tensors one
        after the other, as given (scaled, history included, without what images filled); `output`, its raw actions, step after step. Both are empty where
        `by_client` (a policy in Python or C). `after_reset`: it had forgotten its past before, or was told to; `sender`, whose mailbox: "policy", "fallback" or
        "candidate". Empty where `record.policy_inputs` is false.
        """
        fields = self._recording.fields.get("/takt/policy_input", [])
        messages = _mcap.rows(fields, self._recording.bodies.get("/takt/policy_input", []))
        hashes = {tuple(image[name] for name in _IMAGE_KEY): image["sha256"] for image in self._images}
        for message in messages:
            keys = zip(*(message[f"sample_{name}"].tolist() for name in _IMAGE_KEY))
            message["sample_image"] = [hashes.get(key, "") for key in keys]
            message["sender"] = _SENDERS[message["sender"]]
            ends = np.cumsum(message.pop("sample_value_count"), dtype=np.int64)
            message["sample_values"] = np.split(message["sample_values"], ends[:-1]) if len(ends) else []
            for name in ("after_reset", "built_in", "by_client"):
                message[name] = bool(message[name])
        columns = [field.name for field in fields if field.name != "sample_value_count"]
        return _pandas().DataFrame(messages, columns=columns + ["sample_image"] if columns else None)

    @functools.cached_property
    def sensors(self) -> "pandas.DataFrame":
        """The samples of outside sensors that the run holds, each once however many answers or ticks rest on it, in the order in which they were sensed:
        those that a policy was shown (what its process claims), and those of the base's IMU that the executive read (one per tick at most). `s`: when it was
        sensed, seconds since the first tick; `sensor`: its name in the robot file (None: there is no such one); `sequence`, `sensed_at`, `published_at`
        (<NA> where only ticks had it); `values`: float32, (values,), of the IMU rotation w x y z, angular velocity, specific force; `unit`: the robot
        file's word; `image`: the SHA-256 for image(), where it is one, whose values are empty, else "". What stands in for a command that is absent is
        no sample. A sensor in one array: np.stack(run.sensors.query("sensor == 'target'")["values"]).
        """
        return _samples.table(_pandas(), self.folder / "config.yaml", self.tick_array, self.policy_inputs)

    @functools.cached_property
    def images(self) -> "pandas.DataFrame":
        """Every image that a policy was shown, once: `sensor` (place in the robot file's `sensors`), `sequence`, `sensed_at`, `published_at` of its sample,
        `height`, `width`, `channels`, `sha256` (of its file; "": the recorder never had it) and `file`, what became of that: "stored", "lost" (it was stored
        and is not there any more), "over_budget", "over_rate", "behind", "unwritten" (docs/run-folder.md says why) or "unseen". image() has the bytes.
        """
        fields = self._recording.fields.get("/takt/image", [])
        rows = [dict(image) for image in self._images]
        for row in rows:
            if row["file"] == "stored" and not self._image_path(row).is_file():
                row["file"] = "lost"
        return _pandas().DataFrame(rows, columns=[field.name for field in fields] or None)

    def image(self, sha256: str) -> NDArray[np.uint8]:
        """The image of this hash, (height, width, channels): of `images`, or of `sample_image` in `policy_inputs`. Raises Refused where it has no file, and
        where the file is not what was recorded.
        """
        found = next((image for image in self._images if image["sha256"] == sha256), None)
        if found is None or not sha256:
            raise Refused(f"{self.folder}: no policy was shown an image {sha256!r}")
        path, shape = self._image_path(found), (found["height"], found["width"], found["channels"])
        if not path.is_file():
            raise Refused(f"{path} is missing: " + ("it was lost since the run" if found["file"] == "stored" else f"it went without a file, {found['file']}"))
        content = bytes(_files.mapped(path))
        if hashlib.sha256(content).hexdigest() != sha256:
            raise Refused(f"{path} is not what was recorded: its SHA-256 is another")
        return np.frombuffer(content, np.uint8)[-int(np.prod(shape)):].reshape(shape)

    @functools.cached_property
    def _images(self) -> List[Dict[str, Any]]:
        fields = self._recording.fields.get("/takt/image", [])
        names: Mapping[int, str] = next((field.names for field in fields if field.name == "file"), {})
        rows = _mcap.rows(fields, self._recording.bodies.get("/takt/image", []))
        for row in rows:
            row["file"] = names.get(row["file"], row["file"])
        return rows

    def _image_path(self, image: Mapping[str, Any]) -> pathlib.Path:
        suffix = {1: ".pgm", 3: ".ppm"}.get(image["channels"], ".pam")
        return self.folder / "images" / f"{image['sha256']}{suffix}"

    @functools.cached_property
    def transitions(self) -> "pandas.DataFrame":
        """Every change of mode: tick, monotonic_ns, from, to, cause, detail, incident (why it stopped, in one sentence), age_ns."""
        return _pandas().DataFrame(_lines(self.folder / "transitions.jsonl"))

    @functools.cached_property
    def events(self) -> "pandas.DataFrame":
        """What `takt run` did and saw: processes that started and ended, scripted actions, requests, marks. `tick`: the one in which it happened (-1: before the
        first); `monotonic_ns`, `utc`, `event`, and what that event says, NaN in rows of other events. Empty: `takt run` wrote none.
        """
        path, columns = self.folder / "events.jsonl", ["tick", "monotonic_ns", "utc", "event"]
        lines = [line for line in (_lines(path) if path.exists() else []) if isinstance(line, dict) and type(line.get("monotonic_ns")) is int]
        frame = _pandas().DataFrame(lines, columns=None if lines else columns)
        ticks = self.tick_array
        before = [int(np.searchsorted(ticks["now"], line["monotonic_ns"], side="right")) - 1 for line in lines]
        frame["tick"] = [int(ticks["tick"][at]) if at >= 0 else -1 for at in before]
        return frame.reindex(columns=columns + [name for name in frame.columns if name not in columns])

    @functools.cached_property
    def losses(self) -> "pandas.DataFrame":
        """What was not recorded: ring, reason, count, after_tick, before_tick. Empty: nothing."""
        fields = self._recording.fields.get("/takt/loss", [])
        return _pandas().DataFrame(_mcap.rows(fields, self._recording.bodies.get("/takt/loss", [])), columns=[field.name for field in fields] or None)

    @functools.cached_property
    def _recording(self) -> _mcap.Recording:
        recording = _mcap.Recording(self.folder / "ticks.mcap")
        if "/takt/tick" not in recording.fields:
            raise Refused(f"{self.folder / 'ticks.mcap'} has no topic /takt/tick: it ended before the first tick, or is not Takt's")
        return recording

    @staticmethod
    def _named(field: _mcap.Field, values: NDArray[Any]) -> Any:
        if not field.names:
            return values
        numbers = sorted(field.names)
        codes = np.searchsorted(numbers, values)
        codes[~np.isin(values, numbers)] = -1  # a value without a name
        return _pandas().Categorical.from_codes(codes, [field.names[number] for number in numbers])


class Artifact:
    """What a panel left behind: one row per rollout."""

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder
        self.manifest: Mapping[str, Any] = _files.json_of(folder / "manifest.json")

    def __repr__(self) -> str:
        return f"takt.Artifact({str(self.folder)!r})"

    @functools.cached_property
    def rows(self) -> "pandas.DataFrame":
        """Every rollout; what a row nests has a dot in its column's name, as "age_per_tick.total.p99_ms"."""
        return _pandas().json_normalize(_lines(self.folder / "rollouts.jsonl"))


def open(folder: Union[str, "os.PathLike[str]"]) -> Any:  # noqa: A001 - takt.open(...)
    """A Run, of a run folder (`takt run`, takt-monitor), or an Artifact, of a panel's. Raises Refused in one sentence where it is neither.
    For type checkers: `run: takt.Run = takt.open("run")`.
    """
    path = pathlib.Path(folder)
    if (path / "ticks.mcap").is_file():
        return Run(path)
    if (path / "rollouts.jsonl").is_file():
        return Artifact(path)
    raise Refused(f"takt.open: {path} is neither a run folder nor a panel's artifact: it holds no ticks.mcap and no rollouts.jsonl")
