"""What a run or a panel left behind, as tables."""
import functools
import json
import os
import pathlib
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from takt import _mcap
from takt._refused import Refused

if TYPE_CHECKING:
    import pandas

_AGE_PARTS = ("age_sense", "age_queue", "age_infer", "age_publish", "age_hold")
_SENDERS = {1: "policy", 2: "fallback", 3: "candidate"}
_COMMAND_FIELDS = {"q": 1, "dq": 2, "kp": 4, "kd": 8, "tau": 16}


def _pandas() -> Any:
    try:
        import pandas
    except ImportError:
        raise Refused("takt: tables need the Python module pandas: sudo apt install python3-pandas (tick_array does without)") from None
    return pandas


def _json(path: pathlib.Path) -> Any:
    try:
        return json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise Refused(f"{path} cannot be read: {error}") from None


def _lines(path: pathlib.Path) -> List[Any]:
    """A line that a power failure cut off is left out."""
    lines = []
    for line in path.read_text().splitlines():
        try:
            lines.append(json.loads(line))
        except ValueError:
            break
    return lines


class Run:
    """A run folder. Tables are read when they are first asked for, and kept.

    Times are ns of CLOCK_MONOTONIC (`s`: seconds since the first tick); angles rad, speeds rad/s, torques Nm, gains Nm/rad and Nms/rad.
    """

    def __init__(self, folder: pathlib.Path) -> None:
        self.folder = folder
        self.manifest: Mapping[str, Any] = _json(folder / "manifest.json")
        self.joints: Tuple[str, ...] = tuple(self.manifest["joints"])
        self.buses: Tuple[str, ...] = tuple(self.manifest["buses"])

    def __repr__(self) -> str:
        return f"takt.Run({str(self.folder)!r})"

    @property
    def metrics(self) -> Mapping[str, Any]:
        """The numbers of the report: metrics.json."""
        return _json(self.folder / "metrics.json")

    @functools.cached_property
    def tick_array(self) -> NDArray[Any]:
        """Every recorded tick, as a structured array with the fields of takt_msgs/msg/Tick; a field of each joint has the shape (ticks, joints)."""
        return _mcap.table(self._recording.fields["/takt/tick"], self._recording.bodies["/takt/tick"])

    @functools.cached_property
    def enumerations(self) -> Mapping[str, Mapping[int, str]]:
        """Names of the values of those of a tick's fields that have some: {"mode": {0: "standby", ...}, ...}."""
        return {field.name: field.names for field in self._recording.fields["/takt/tick"] if field.names}

    @functools.cached_property
    def about(self) -> Mapping[str, str]:
        """What each of a tick's fields is, and its unit: {"q_estimate": "output; rad", ...}."""
        return {field.name: field.about for field in self._recording.fields["/takt/tick"]}

    @functools.cached_property
    def ticks(self) -> "pandas.DataFrame":
        """Every recorded tick. Enumerations by name; a column of each joint and each bus for what they have one by one, as "q_estimate.elbow"
        and "bus_state.can0"; `age_ms`: of the command that the tick relied on, all parts of it together.
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
                columns[f"{field.name}.{owner}"] = self._named(field, values[:, index])
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
        """What the policy's network was shown for each of its answers, and what it said: claims of the policy's host. `observation_id` and `sequence` name
        the command in `commands`. `q`: positions in the answered observation, rad; `input`: the network's input tensors one after the other, as given (scaled,
        history included); `output`: its raw actions, step after step. `sample_values`: one array for each sample of an outside sensor that went in, SI units,
        beside `sample_sensor` (place in the robot file's `sensors`) and its stamps. `after_reset`: it had forgotten its past before; `sender`, whose mailbox:
        "policy", "fallback" or "candidate". Empty where nobody told: `record.policy_inputs` false, images, a policy in Python or C.
        """
        fields = self._recording.fields.get("/takt/policy_input", [])
        messages = _mcap.rows(fields, self._recording.bodies.get("/takt/policy_input", []))
        for message in messages:
            message["sender"] = _SENDERS[message["sender"]]
            ends = np.cumsum(message.pop("sample_value_count"), dtype=np.int64)
            message["sample_values"] = np.split(message["sample_values"], ends[:-1]) if len(ends) else []
            for name in ("after_reset", "built_in"):
                message[name] = bool(message[name])
        return _pandas().DataFrame(messages, columns=[field.name for field in fields if field.name != "sample_value_count"])

    @functools.cached_property
    def transitions(self) -> "pandas.DataFrame":
        """Every change of mode: tick, monotonic_ns, from, to, cause, detail, incident (why it stopped, in one sentence), age_ns."""
        return _pandas().DataFrame(_lines(self.folder / "transitions.jsonl"))

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
        self.manifest: Mapping[str, Any] = _json(folder / "manifest.json")

    def __repr__(self) -> str:
        return f"takt.Artifact({str(self.folder)!r})"

    @functools.cached_property
    def rows(self) -> "pandas.DataFrame":
        """Every rollout; what a row nests has a dot in its column's name, as "age_per_tick.total.p99_ms"."""
        return _pandas().json_normalize(_lines(self.folder / "rollouts.jsonl"))


def open(folder: Union[str, "os.PathLike[str]"]) -> Union[Run, Artifact]:  # noqa: A001 - takt.open(...)
    """A run folder (`takt run`, takt-monitor) or a panel's artifact. Raises Refused in one sentence where it is neither."""
    path = pathlib.Path(folder)
    for name, kind in (("ticks.mcap", Run), ("rollouts.jsonl", Artifact)):
        if (path / name).is_file():
            return kind(path)
    raise Refused(f"takt.open: {path} is neither a run folder nor a panel's artifact: it holds no ticks.mcap and no rollouts.jsonl")
