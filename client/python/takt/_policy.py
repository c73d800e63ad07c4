# SPDX-License-Identifier: Apache-2.0
"""A policy: what it reads and gives, the connection to a running robot, and its observations."""
import argparse
import ctypes
import logging
import os
import pathlib
import signal
import sys
import threading
import time
from dataclasses import dataclass
from typing import Any, Dict, Iterator, Mapping, NoReturn, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from takt import _library
from takt._refused import Refused
from takt._sensor import place

_WAIT_NS = 100_000_000  # a signal is heeded within this time
_SAY_AGAIN_S = 10.0

_log = logging.getLogger("takt")


@dataclass(frozen=True)
class Joints:
    """A term with one row per quantity and one column per joint: takt.joints()."""

    quantities: Tuple[str, ...]


@dataclass(frozen=True)
class Stream:
    """A term with the newest sample of an outside sensor: takt.stream()."""

    name: str
    values: int
    unit: Optional[str] = None
    max_age: Optional[str] = None


@dataclass(frozen=True)
class Queue:
    """A term with the samples of an outside sensor since the last observation: takt.queue()."""

    name: str
    values: int
    unit: Optional[str] = None
    max_age: Optional[str] = None


@dataclass(frozen=True)
class Image:
    """A term with the newest image of an outside sensor: takt.image()."""

    name: str
    shape: Optional[Tuple[int, int, int]]
    max_age: Optional[str]


Term = Union[Joints, Stream, Queue, Image]


@dataclass(frozen=True)
class Chunk:
    """What a policy gives: `steps` targets per joint, `step` apart, made to follow one another by `join`: takt.chunk()."""

    field: str
    steps: int
    step: str
    join: Optional[str] = None


@dataclass(frozen=True)
class Assumption:
    """What a speculative chunk assumes: the joints at `q` (rad), moving with `dq` (rad/s; None: with any velocity), (joints,) each,
    `ahead` seconds (more than 0) after the observation that it answers. The chunk's step 0 is meant for that instant.
    """

    ahead: float
    q: ArrayLike
    dq: Optional[ArrayLike] = None


@dataclass(frozen=True)
class Alternatives:
    """Counts of answers with an assumption: robot.alternatives."""

    kept: int
    taken: int  # matched, were the nearest, and were published
    outdone: int  # matched too, and another was nearer
    unmatched: int  # the state was another
    dropped: int  # never compared: too old, too many, their observation was missed, or what was remembered went


def joints(*quantities: str) -> Joints:
    """Of every joint: "q" (position, rad), "dq" (velocity, rad/s), "tau" (torque, Nm), "q_setpoint" (what the drives were last
    told, rad), "dq_of_drive" (velocity as the drive reports it, rad/s). The term has the shape (quantities, joints), float32,
    in the order in which they are named and in that of robot.joints. Raises Refused for a name that is none of these.
    """
    for name in quantities:
        if name not in _library.KINDS:
            raise Refused(f"takt.joints: there is no quantity {name!r}; there are {', '.join(_library.KINDS)}")
    if not quantities:
        raise Refused("takt.joints: name at least one of " + ", ".join(_library.KINDS))
    return Joints(quantities)


def stream(name: str, values: int, *, unit: Optional[str] = None, max_age: Optional[str] = None) -> Stream:
    """The newest sample of the outside sensor `name`, which the robot file lists under `sensors` and under
    `policy.observation`. The term has the shape (values,), float32, in the sensor's units. A sample older than the sensor's
    `timeout` is not passed on, and neither is its observation. `unit` ("m/s") and `max_age` ("80 ms"), where they are given, are
    compared with the sensor's `unit`, letter by letter, and `timeout`.
    """
    return Stream(name, int(values), unit, max_age)


def queue(name: str, values: int, *, unit: Optional[str] = None, max_age: Optional[str] = None) -> Queue:
    """All samples of the outside sensor `name` since the last observation, oldest first; the robot file says by the sensor's
    `queue` how many at most, of which the newest stay. The term has the shape (samples, values), float32, with `samples` different
    each time; obs.stamps(TERM) says when each was sensed, obs.lost(TERM) how many are missing. Age is that of the newest. `unit`
    and `max_age` as in takt.stream.
    """
    return Queue(name, int(values), unit, max_age)


def image(name: str, *, shape: Optional[Tuple[int, int, int]] = None, max_age: Optional[str] = None) -> Image:
    """The newest image of the outside sensor `name`: uint8, (height, width, channels) as the robot file has it; `shape`, where it
    is given, is compared with that. The age of every command counts from the image's own stamp. `max_age` ("80 ms"), where it
    is given, is compared with the sensor's `timeout`: an older image is not passed on, and neither is its observation.
    """
    return Image(name, shape, max_age)


def chunk(field: str, *, steps: int, step: str, join: Optional[str] = None) -> Chunk:
    """Joint position targets: field "q", rad. Step 0 is meant for the instant obs.time, step k for k times `step` ("10 ms") later.
    Both are what the robot file's policy.steps and policy.step_period say. `join`, where it is given, is compared with its
    policy.action.join: how one chunk takes over from the one before, "replace", "cross_fade", "blend", "ensemble", "align",
    "quintic" or "prefix". "rtc" (real-time chunking) is "prefix": for policies that go on from obs.committed. Raises Refused for
    another field or join.
    """
    if field != "q":
        raise Refused(f"takt.chunk: a chunk's targets are 'q' (rad), not {field!r}; dq, kp, kd and tau may go with them in publish()")
    if join is not None and join not in _library.JOINS:
        raise Refused(f"takt.chunk: there is no join {join!r}; there are {', '.join(_library.JOINS)} (which is prefix)")
    return Chunk(field, int(steps), step, join)


@dataclass(frozen=True)
class Policy:
    """What a policy is: named terms of its observation, which become attributes of `obs`, and its action. Raises Refused where a name is
    no free one of an attribute, and where there is none.
    """

    observation: Mapping[str, Term]
    action: Chunk

    def __post_init__(self) -> None:
        taken = [name for name in self.observation if hasattr(Observation, name) or name.startswith("_") or not name.isidentifier()]
        if taken:
            raise Refused(f"takt.Policy: an observation cannot be named {taken[0]!r}: that is no free name of an attribute; choose another")
        if not self.observation:
            raise Refused("takt.Policy: an observation has at least one term")


class _Handle:
    """The library's policy. Freed with the last that refers to it, so that no array ever outlives its memory."""

    def __init__(self, library: ctypes.CDLL, pointer: ctypes.c_void_p) -> None:
        self.pointer = pointer
        self._close = library.takt_policy_close

    def __del__(self) -> None:
        self._close(self.pointer)

    def array(self, address: int, count: int, dtype: Any = np.float32) -> NDArray[Any]:
        memory: Any = (ctypes.c_ubyte * (count * np.dtype(dtype).itemsize)).from_address(address)
        memory.owner = self
        values: NDArray[Any] = np.frombuffer(memory, dtype)
        values.flags.writeable = False
        return values


class _Infer:
    """`with obs.infer():` stamps when the inference began and ended."""

    def __init__(self, robot: "Robot") -> None:
        self._robot, self._pointer = robot, robot._handle.pointer
        self._begin = robot._library.takt_policy_infer_begin
        self._end = robot._library.takt_policy_infer_end

    def __enter__(self) -> None:
        if result := self._begin(self._pointer):
            self._robot._refuse(result)

    def __exit__(self, *error: object) -> None:
        if result := self._end(self._pointer):
            self._robot._refuse(result)


class Observation:
    """One observation, and the answer to it. The terms of the Policy are its attributes: float32 arrays on memory of the
    client, which the next step overwrites; copy what you keep.
    """

    def __init__(self, robot: "Robot", terms: Mapping[str, Term]) -> None:
        self._robot, self._pointer = robot, robot._handle.pointer
        self._raw = robot._library.takt_policy_observation(self._pointer).contents
        self._publish = robot._library.takt_policy_publish
        self._source = ""  # that was stated last
        self._infer = _Infer(robot)
        self._chunk = _library.ChunkStruct(size=ctypes.sizeof(_library.ChunkStruct))
        self._assumption = _library.AssumptionStruct(size=ctypes.sizeof(_library.AssumptionStruct))
        self._chunk_by_reference = ctypes.byref(self._chunk)
        self._shape = (robot.steps, len(robot.joints))
        self._committed = np.empty((0, len(robot.joints)), np.float32)
        self._committed.flags.writeable = False
        values = robot._handle.array(ctypes.addressof(self._raw.values.contents), self._raw.value_count) if self._raw.value_count else np.empty(0)
        self._queues: Dict[str, Tuple[Any, NDArray[np.float32], NDArray[np.int64]]] = {}
        begin, images = 0, 0
        shape: Tuple[int, ...]
        for name, term in terms.items():
            if isinstance(term, Image):
                stream = robot._stream(term.name)
                shape = (stream.height, stream.width, stream.channels)
                setattr(self, name, robot._handle.array(self._raw.images[images], stream.values, np.uint8).reshape(shape))
                images += 1
                continue
            if isinstance(term, Queue):
                raw = self._raw.queues[len(self._queues)]
                samples = robot._handle.array(ctypes.addressof(raw.values.contents), raw.capacity * raw.value_count)
                stamps = robot._handle.array(ctypes.addressof(raw.sensed_ns.contents), raw.capacity, np.int64)
                self._queues[name] = (raw, samples.reshape(raw.capacity, raw.value_count), stamps)
                continue
            shape = (len(term.quantities), len(robot.joints)) if isinstance(term, Joints) else (term.values,)
            end = begin + int(np.prod(shape))
            setattr(self, name, values[begin:end].reshape(shape))
            begin = end

    def __getattr__(self, name: str) -> NDArray[Any]:  # for type checkers: terms are attributes
        if name in self.__dict__.get("_queues", ()):
            raw, samples, _ = self._queues[name]
            return samples[:raw.count]
        raise AttributeError(f"this observation has no term {name!r}; name it in takt.Policy(observation=...)")

    @property
    def id(self) -> int:
        """Number of the observation in this session: 1, 2, 3, ..."""
        return int(self._raw.id)

    @property
    def time(self) -> int:
        """When the executive published it, ns of time.monotonic_ns(). Step 0 of the answer is meant for this instant."""
        return int(self._raw.published_ns)

    @property
    def sensed(self) -> int:
        """When the oldest of the samples in it was sensed, streams included, ns of time.monotonic_ns()."""
        joints, outside = int(self._raw.sensed_ns), int(self._raw.outside_sensed_ns)
        return min(joints, outside) if outside else joints

    @property
    def mode(self) -> str:
        """Of the executive when it published: "standby", "arming", "tracking", "degraded", "damped_stop" or "fault_latched"."""
        return str(self._raw.mode, "utf-8")

    @property
    def dropped(self) -> int:
        """Observations published since the previous one that this policy never saw."""
        return int(self._raw.dropped)

    def stamps(self, term: str) -> NDArray[np.int64]:
        """Of a queue's samples: when each was sensed, (samples,), int64, ns of time.monotonic_ns(). Raises Refused, 64, for another term."""
        raw, _, stamps = self._queue(term)
        return stamps[:raw.count]

    def lost(self, term: str) -> int:
        """Samples of a queue since the last observation that are not in it: more came than it holds, or they were no numbers. Raises
        Refused, 64, for another term.
        """
        return int(self._queue(term)[0].dropped)

    def _queue(self, term: str) -> Tuple[Any, NDArray[np.float32], NDArray[np.int64]]:
        if term not in self._queues:
            raise Refused(f"observation: {term!r} is no queue; name it in takt.Policy(observation=...) as takt.queue(...)", _library.USAGE)
        return self._queues[term]

    @property
    def reset(self) -> bool:
        """True: forget hidden state. A new session, a long gap, the robot began to arm, or the last answer was not finite."""
        return bool(self._raw.reset)

    @property
    def committed(self) -> NDArray[np.float32]:
        """What the robot will do whatever answers this observation, for a network that goes on from it: (count, joints), rad, oldest
        first, float32, read-only, of shape (0, joints) where nothing is promised, which is always so unless `policy.action.join` is
        `prefix`. Row i is for step i of the answer, the instant obs.time plus i times robot.step: where your earlier chunk, as you
        published it, leads the robot then, read between its steps as `policy.action.interpolation` says. The last row may reach
        up to a step past the promise, along the same path. Overwritten by the next step, as the terms are.
        """
        if not self._raw.committed:
            return self._committed[:0]
        if not len(self._committed):
            rows = self._robot._handle.array(self._raw.committed, self._shape[0] * self._shape[1])
            self._committed = rows.reshape(self._shape)
        return self._committed[:self._raw.committed_count]

    @property
    def committed_steps(self) -> Tuple[int, int, int]:
        """Which steps those are: (publish, first, count), where `publish` (1, 2, ...; 0: none) counts this session's calls of publish().
        The robot follows the chunk of that one, and plays `count` of its steps from `first` on, the one that it plays at obs.time.
        """
        return self._raw.following, self._raw.committed_from, self._raw.committed_count

    def infer(self) -> _Infer:
        """Around the network's work: `with obs.infer(): ...`. Without it the whole step counts as inference."""
        return self._infer

    def publish(self, *, q: ArrayLike, dq: Optional[ArrayLike] = None, kp: Optional[ArrayLike] = None,
                kd: Optional[ArrayLike] = None, tau: Optional[ArrayLike] = None, assumes: Optional[Assumption] = None,
                source: Optional[str] = None) -> None:
        """Answers this observation. Each array has the shape (steps, joints): q rad, dq rad/s, kp Nm/rad, kd Nms/rad, tau Nm
        (added to the controller's torque); it is copied before this returns. dq is part of `policy.action.interpolation: cubic`, may
        stand beside `hold`, and is refused with `linear`; without kp and kd the joint's gains hold. Values travel as they
        are: the executive refuses a command that is not finite, and clamps and counts what is out of a joint's range. Raises Refused, 64,
        for another shape, and where dq or an assumption is not what the robot file takes. Never waits.

        `assumes` makes it speculative: it waits here, and answers the first observation of that instant if the joints are there then,
        within `policy.speculation`. Publish several with assumptions of their own for the same instant: they are alternatives.

        `source` is the process that made it, where that is another: `server.source`. The run says so, from this command on.
        """
        chunk = self._chunk
        chunk.q = self._bytes("q", q)
        chunk.dq = None if dq is None else self._bytes("dq", dq)
        chunk.kp = None if kp is None else self._bytes("kp", kp)
        chunk.kd = None if kd is None else self._bytes("kd", kd)
        chunk.tau_ff = None if tau is None else self._bytes("tau", tau)
        chunk.assumes = None if assumes is None else self._assumed(assumes)
        if source is not None and source != self._source:
            self._source = source
            self._robot._library.takt_policy_state_source(self._pointer, _printable(source))
        if result := self._publish(self._pointer, self._chunk_by_reference):
            self._robot._refuse(result)

    def withhold(self, problem: str) -> None:
        """Answers this observation with nothing, and says why: `takt status`, the incident and the run quote it, until the next publish."""
        self._robot._library.takt_policy_state_problem(self._pointer, _printable(problem))

    def _assumed(self, given: Assumption) -> "ctypes._Pointer[_library.AssumptionStruct]":
        assumption = self._assumption
        assumption.at_ns = self._raw.published_ns + round(given.ahead * 1e9)
        assumption.q = self._bytes("assumes.q", given.q, self._shape[1:])
        assumption.dq = None if given.dq is None else self._bytes("assumes.dq", given.dq, self._shape[1:])
        return ctypes.pointer(assumption)

    def _bytes(self, name: str, given: ArrayLike, shape: Optional[Tuple[int, ...]] = None) -> bytes:
        array = np.asarray(given, np.float32)
        if array.shape != (shape or self._shape):
            what = f"joints {shape}: (joints,)" if shape else f"chunk {self._shape}: (steps, joints)"
            raise Refused(f"publish: {name} has the shape {array.shape}, this robot's {what}", _library.USAGE)
        return array.tobytes()  # a hundred numbers: cheaper than asking numpy for their address


class Robot:
    """A robot under this policy. Iterate over it for the newest observation, again and again; the loop ends with SIGTERM or the
    first Ctrl-C, between two steps. While no executive is there, or a stream has no usable sample, it waits, and says so in
    the log "takt". The executive's refusal (another robot file, policy or version) is raised as Refused, 69. Use it in a `with` statement.
    """

    name: str  # of the robot
    joints: Tuple[str, ...]  # their names, in the order of every array
    home: NDArray[np.float32]  # (joints,), rad
    steps: int  # of a chunk
    step: float  # s between two of them
    period: float  # s between two observations
    policy_file: str  # absolute path; its SHA-256 is the policy's identity

    def __init__(self, library: ctypes.CDLL, handle: _Handle, spec: Policy) -> None:
        self._library, self._handle = library, handle
        self._stopped = False
        self._before: Dict[int, Any] = {}
        self._said, self._say_again_at = "", 0.0
        facts = library.takt_policy_robot(handle.pointer).contents
        self.name = facts.name.decode()
        self.joints = tuple(facts.joints[i].decode() for i in range(facts.joint_count))
        self.home = np.array(facts.home[:facts.joint_count], np.float32)
        self.steps = facts.steps
        self.step = facts.step_ns * 1e-9
        self.period = facts.period_ns * 1e-9
        self.policy_file = os.fsdecode(facts.policy_file)
        for term in spec.observation.values():
            if isinstance(term, Image):
                self._check_image(term)
        self._observation = Observation(self, spec.observation)

    def __enter__(self) -> "Robot":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def alternatives(self) -> Alternatives:
        """What became of the answers with an assumption, since connect(). Those that are in none of the last four counts wait."""
        counts = self._library.takt_policy_alternatives(self._handle.pointer).contents
        return Alternatives(*(getattr(counts, field) for field, _ in _library.AlternativesStruct._fields_))

    def close(self) -> None:
        """Gives the lease back, and signals their handlers. What was observed last may still be read."""
        for number, handler in self._before.items():
            signal.signal(number, handler or signal.SIG_DFL)
        self._before.clear()
        self._stopped = True
        self._library.takt_policy_detach(self._handle.pointer)

    def __iter__(self) -> Iterator[Observation]:
        while not self._stopped:
            result = self._library.takt_policy_next(self._handle.pointer, _WAIT_NS)
            if result == _library.OK:
                self._said = ""
                yield self._observation
            elif result == _library.NOTHING:
                self._say(self._sentence())
            else:
                self._refuse(result)

    def _attach(self) -> None:
        while not self._stopped:
            result = self._library.takt_policy_attach(self._handle.pointer, _WAIT_NS)
            if result == _library.OK:
                return
            if result != _library.NOTHING:
                self._refuse(result)
            self._say(self._sentence())

    def _stop_on_signals(self) -> None:
        if threading.current_thread() is not threading.main_thread():
            return
        for number in (signal.SIGTERM, signal.SIGINT):
            self._before[number] = signal.signal(number, self._stop)

    def _stop(self, number: int, _frame: object) -> None:
        # A second one does what it did before: a policy that hangs in a step can still be ended.
        signal.signal(number, self._before[number] or signal.SIG_DFL)
        self._stopped = True

    def _stream(self, name: str) -> "_library.StreamStruct":
        stream: _library.StreamStruct = self._library.takt_policy_stream(self._handle.pointer, name.encode()).contents
        return stream

    def _check_image(self, term: Image) -> None:
        stream = self._stream(term.name)
        shape = (stream.height, stream.width, stream.channels)
        if term.shape is not None and tuple(term.shape) != shape:
            raise Refused(f"takt.image: sensor {term.name} has the shape {shape} in the robot file, the policy's {tuple(term.shape)}: make them equal")

    def _sentence(self) -> str:
        return str(self._library.takt_policy_sentence(self._handle.pointer), "utf-8")

    def _refuse(self, result: int) -> NoReturn:
        raise Refused(self._sentence(), result)

    def _say(self, sentence: str) -> None:
        now = time.monotonic()
        if not sentence or (sentence == self._said and now < self._say_again_at):
            return
        self._said, self._say_again_at = sentence, now + _SAY_AGAIN_S
        _log.warning("%s", sentence)


def _terms_of(spec: Policy) -> "ctypes.Array[_library.TermStruct]":
    flat = []
    for term in spec.observation.values():
        if isinstance(term, Joints):
            flat += [_library.TermStruct(kind=_library.KINDS[name]) for name in term.quantities]
            continue
        flat.append(_library.TermStruct(stream=term.name.encode(), max_age=_text(term.max_age)))
        if isinstance(term, Image):
            flat[-1].kind = _library.IMAGE
            continue
        flat[-1].kind = _library.QUEUE if isinstance(term, Queue) else _library.STREAM
        flat[-1].values, flat[-1].unit = term.values, _text(term.unit)
    return (_library.TermStruct * len(flat))(*flat)


def _printable(text: str) -> bytes:
    return text.encode("ascii", "replace")


def _text(text: Optional[str]) -> Optional[bytes]:
    return None if text is None else text.encode()


def _check_identity(robot_file: str, policy_file: str) -> None:
    """Where `policy.file` is a Python program, its SHA-256 speaks for the program that runs."""
    program = getattr(sys.modules.get("__main__"), "__file__", None)
    if pathlib.Path(policy_file).suffix != ".py" or (program and os.path.samefile(program, policy_file)):
        return
    raise Refused(f"{robot_file}: policy.file is {policy_file}, and the program that runs is {program}: name it there, or the file "
                  "that holds what it has learned")


def _asked(candidate: Union[str, "os.PathLike[str]", None], arguments: Optional[Sequence[str]]) -> Tuple[Optional[str], bool]:
    """The candidate's file, the command line's where it names one; and whether to compare only."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--candidate", default=None if candidate is None else os.fspath(candidate))
    parser.add_argument("--check", action="store_true")
    given, _ = parser.parse_known_args(sys.argv[1:] if arguments is None else arguments)
    return given.candidate, given.check


def connect(robot_file: Union[str, "os.PathLike[str]"], spec: Policy, *, runtime_dir: Optional[str] = None,
            candidate: Union[str, "os.PathLike[str]", None] = None, arguments: Optional[Sequence[str]] = None) -> Robot:
    """Compares the spec with the robot file, and takes the robot's one policy lease; waits for an executive that is not there yet.

    `candidate`: the policy runs beside the robot's own instead, judged and not played until `takt policy swap`; the file whose
    SHA-256 is its identity: this program, or what it has learned. `--robot`, `--runtime-dir` and `--candidate` in `arguments`
    (default: this program's command line, where `takt run` and `takt policy shadow` put them with `--policy-host`) win over the
    parameters. With `--check` among them the comparison is all: a line says that they fit, and the program ends with 0. SIGTERM and SIGINT end the iteration from here on, until the robot is closed; a second one does
    what it did before. Raises Refused with one sentence: 65 for names, shapes, units, ages, joins that are not the robot file's, 69 where
    the executive has another robot file, policy or version, or a policy already.
    """
    if not isinstance(spec, Policy):
        raise Refused("takt.connect: the second argument is a takt.Policy", _library.USAGE)
    library = _library.load()
    file, directory = place(os.fspath(robot_file), runtime_dir, arguments)
    beside, only_check = _asked(candidate, arguments)
    terms = _terms_of(spec)
    wanted = _library.SpecStruct(
        size=ctypes.sizeof(_library.SpecStruct), term_count=len(terms), terms=terms, robot_file=os.fsencode(file),
        runtime_directory=None if directory is None else os.fsencode(directory),
        program=os.path.basename(sys.argv[0] or "python3")[:39].encode(), step=spec.action.step.encode(), steps=spec.action.steps,
        candidate_file=None if beside is None else os.fsencode(beside), join=_text(spec.action.join))
    handle, why = ctypes.c_void_p(), ctypes.create_string_buffer(2048)
    result = library.takt_policy_open(wanted, handle, why, len(why))
    if result != _library.OK:
        raise Refused(why.value.decode(errors="replace"), result)
    robot = Robot(library, _Handle(library, handle), spec)
    try:
        _check_identity(file, robot.policy_file)
        if only_check:
            print(f"{file}: the policy fits: {', '.join(spec.observation)} in, {robot.steps} steps of {len(robot.joints)} joints out")
            sys.exit(0)
        robot._stop_on_signals()
        robot._attach()
    except BaseException:
        robot.close()
        raise
    return robot
