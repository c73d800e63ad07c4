# SPDX-License-Identifier: Apache-2.0
"""A world for Takt in Python: a process that plays a robot's mechanics (docs/world-protocol.md). Needs numpy and Linux.

    import numpy as np
    from takt import world

    class Flywheels:
        def reset(self, robot, seed, q):
            self.q, self.dq = q.copy(), np.zeros_like(q)
            return world.State(self.q, self.dq)

        def step(self, drive, seconds):
            self.dq += seconds * drive.torque / 0.1
            self.q += seconds * self.dq
            return world.State(self.q, self.dq)

    world.serve(Flywheels(), "/tmp/world.sock")

A world that sees for the robot puts images into its states (`Image`): `serve(..., cameras={"cam0": (48, 64, 1)})`, and then
`State(..., images={"cam0": world.Image(pixels)})` whenever one is due.

Joints are those of the robot file, in its order. Units: rad, rad/s, Nm, s; of a slide m, m/s, N; an IMU's in `Imu`. Arrays are float64; those that are
passed in are good until the call returns. An exception of reset or step leaves serve(), and Takt is told its text.
"""
import mmap
import os
import socket
import struct
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Optional, Protocol, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

RUNNING, SUCCEEDED, FAILED, UNABLE = range(4)

_PROTOCOL, _MAX_JOINTS, _MAX_VALUES, _MAX_CAMERAS, _ANSWER_OFFSET, _IMAGES_OFFSET = 3, 64, 64, 8, 8192, 12288
_HELLO, _WELCOME, _RESET, _STEP, _STATE = range(1, 6)
_SHARED_MEMORY, _IMU, _POINT, _BASE, _ERROR, _DONE, _PUSH = 1, 2, 4, 8, 16, 32, 64
_HEADER = [("bytes", "<u4"), ("kind", "<u2"), ("protocol", "<u2"), ("sequence", "<u8")]
_JOINTS = ("<f8", _MAX_JOINTS)
_CAMERA_TYPE = np.dtype([("name", "S64"), ("height", "<u4"), ("width", "<u4"), ("channels", "<u4"), ("offset", "<u4")])
_HELLO_TYPE = np.dtype(_HEADER + [("step_ns", "<u8"), ("joint_count", "<u4"), ("camera_count", "<u4"), ("memory_bytes", "<u8"), ("robot", "S64"),
                                  ("joints", "S64", _MAX_JOINTS), ("cameras", _CAMERA_TYPE, _MAX_CAMERAS)])
_WELCOME_TYPE = np.dtype(_HEADER + [("gives", "<u4"), ("sensor_count", "<u4"), ("world", "S64"), ("sensor", "S64"), ("refusal", "S128"),
                                    ("camera_count", "<u4"), ("reserved", "<u4"), ("cameras", _CAMERA_TYPE, _MAX_CAMERAS)])
_RESET_TYPE = np.dtype(_HEADER + [("seed", "<u8"), ("q", *_JOINTS)])
_STEP_TYPE = np.dtype(_HEADER + [("time_ns", "<u8"), ("step_ns", "<u8"), ("torque", *_JOINTS), ("viscous", *_JOINTS), ("coulomb", *_JOINTS),
                                 ("hangs", "<u4"), ("reserved", "<u4"), ("push", "<f8", 3)])
_STATE_TYPE = np.dtype(_HEADER + [("time_ns", "<u8"), ("outcome", "<u4"), ("image_count", "<u4"), ("q", *_JOINTS), ("dq", *_JOINTS), ("point", "<f8", 3),
                                  ("orientation", "<f8", 4), ("angular_velocity", "<f8", 3), ("acceleration", "<f8", 3), ("base_position", "<f8", 3),
                                  ("base_orientation", "<f8", 4), ("error", "<f8"), ("sensor_sequence", "<u8"), ("sensor", "<f8", _MAX_VALUES), ("reason", "S128")])
_HEADER_STRUCT = struct.Struct("<IHHQ")
_AFTER_HEADER = struct.Struct("<QQ")
_OUTCOME_STRUCT = struct.Struct("<QII")
_IMAGE_STRUCT = struct.Struct("<IIQQ")


@dataclass(frozen=True)
class Robot:
    """The robot whose mechanics are played, as its file describes it."""

    name: str
    joints: Tuple[str, ...]  # their names, in the order of every array
    step_seconds: float
    # The cameras of serve(cameras=...) by name, (height, width, channels) of uint8: where their next image may be drawn. What is drawn
    # there and given back as Image(images[name]) is not copied; it is Takt's to read from the return of reset or step to the next call.
    images: Mapping[str, NDArray[np.uint8]]


@dataclass(frozen=True)
class Drive:
    """What the drives do to the joints during a step, (joints,) each: torque (Nm), and the friction that drive and brake add, viscous (Nms/rad)
    and coulomb (Nm; an engaged brake is in there). `push`: (3,), N, world frame, at the base or an arm's tool, for worlds of serve(push=True)."""

    torque: NDArray[np.float64]
    viscous: NDArray[np.float64]
    coulomb: NDArray[np.float64]
    push: NDArray[np.float64]
    _hangs: NDArray[np.uint32]

    @property
    def hangs(self) -> bool:
        """A base that would fall hangs where it began: until all drives were enabled, and 3 s after all were disabled."""
        return bool(self._hangs)


@dataclass(frozen=True)
class Imu:
    """What the base's IMU would say, without noise."""

    orientation: Sequence[float]  # w x y z, of the IMU in the world, length 1
    angular_velocity: Sequence[float]  # rad/s, in the IMU's axes
    acceleration: Sequence[float]  # m/s2, specific force in the IMU's axes: 9.81 upwards at rest


@dataclass(frozen=True)
class Base:
    """Where the base truly is."""

    position: Sequence[float]  # m, world frame, z up
    orientation: Sequence[float]  # w x y z, of the base in the world, length 1


@dataclass(frozen=True)
class Image:
    """What a camera saw."""

    pixels: NDArray[np.uint8]  # (height, width, channels)
    age: float = 0.0  # s from the shutter to the state that it comes with


@dataclass(frozen=True)
class State:
    """How things stand after a reset or a step."""

    q: ArrayLike  # (joints,), rad
    dq: ArrayLike  # (joints,), rad/s
    point: Optional[Sequence[float]] = None  # m, what the task wants at its target; worlds of serve(point=True)
    imu: Optional[Imu] = None  # worlds of serve(imu=True)
    base: Optional[Base] = None  # worlds of serve(base=True)
    error: Optional[float] = None  # how far from what the task wants, 0 or more; worlds of serve(error=True)
    sensor: Optional[Sequence[float]] = None  # a new sample of the sensor of serve(sensor=...); None: no new one
    outcome: int = RUNNING  # SUCCEEDED: the task is done (worlds of serve(done=True)); FAILED: it is beyond help; UNABLE: the world cannot go on
    reason: str = ""  # of the outcome, at most 127 bytes
    images: Optional[Mapping[str, Image]] = None  # new ones of the cameras of serve(cameras=...); None: no new one


class World(Protocol):
    """What serve() plays. An exception leaves serve(), and Takt is told its text."""

    def reset(self, robot: Robot, seed: int, q: NDArray[np.float64]) -> State:
        """The simulation begins anew, from the same seed in the same way, with the joints at `q`, (joints,), rad."""

    def step(self, drive: Drive, seconds: float) -> State:
        """What the drives do, for so long. How things stand at its end."""


class _Gone(Exception):
    """Takt has gone."""


def serve(world: World, path: Union[str, "os.PathLike[str]"], *, name: str = "python", imu: bool = False, point: bool = False, base: bool = False,
          error: bool = False, done: bool = False, push: bool = False, sensor: Optional[Tuple[str, int]] = None,
          cameras: Optional[Mapping[str, Tuple[int, int, int]]] = None, shared_memory: bool = True, simulations: Optional[int] = None) -> None:
    """Plays `world` at the Unix socket `path` for one simulation of Takt's after the other; `simulations`: that many, else for ever.

    `imu`, `point`, `base`, `error`: its states have them. `done`: it says SUCCEEDED when the task is done, and a rollout that ends before has
    failed. `push`: it obeys Drive.push. `sensor`: the robot file's outside sensor that it plays, and how many values that has. `cameras`: the
    robot file's sensors of images whose images it gives, (height, width, channels)."""
    if os.path.exists(path):
        os.unlink(path)
    gives = (_SHARED_MEMORY * shared_memory | _IMU * imu | _POINT * point | _BASE * base | _ERROR * error | _DONE * done | _PUSH * push)
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as listener:
        listener.bind(os.fspath(path))
        listener.listen(4)
        played = 0
        while simulations is None or played < simulations:
            peer = listener.accept()[0]
            with peer:
                try:
                    _Simulation(peer, name, gives, sensor, cameras or {}).play(world)
                except (_Gone, ConnectionError):
                    pass
            played += 1


class _Simulation:
    def __init__(self, peer: socket.socket, name: str, gives: int, sensor: Optional[Tuple[str, int]],
                 cameras: Mapping[str, Tuple[int, int, int]]) -> None:
        self._peer = peer
        self._gives = gives
        data, files, _, _ = socket.recv_fds(peer, _HELLO_TYPE.itemsize, 1)
        while len(data) < _HELLO_TYPE.itemsize:
            data += self._receive(_HELLO_TYPE.itemsize - len(data))
        hello = np.frombuffer(data, _HELLO_TYPE)[0]
        if hello["kind"] != _HELLO or hello["protocol"] != _PROTOCOL or len(files) != 1:
            raise _Gone
        self._memory = mmap.mmap(files[0], int(hello["memory_bytes"]))
        os.close(files[0])
        self._count = int(hello["joint_count"])
        self._find_cameras(hello, cameras)
        self._robot = Robot(hello["robot"].decode(), tuple(joint.decode() for joint in hello["joints"][:self._count]), hello["step_ns"] * 1e-9,
                            {camera: place for camera, (_, place) in self._places.items()})
        sensor_name, values = sensor if sensor is not None else ("", 0)
        self._values, self._samples = values, 0
        self._views()
        welcome = np.zeros((), _WELCOME_TYPE)
        for field, value in (("bytes", _WELCOME_TYPE.itemsize), ("kind", _WELCOME), ("protocol", _PROTOCOL), ("sequence", hello["sequence"]), ("gives", gives),
                             ("sensor_count", values), ("world", name.encode()[:63]), ("sensor", sensor_name.encode()[:63]), ("camera_count", len(cameras))):
            welcome[field] = value
        for said, (camera, shape) in zip(welcome["cameras"], cameras.items()):
            said["name"], said["height"], said["width"], said["channels"] = camera.encode()[:63], *shape
        peer.sendall(welcome.tobytes())

    def _find_cameras(self, hello: Any, cameras: Mapping[str, Tuple[int, int, int]]) -> None:
        """Takt refuses, by the welcome, what the robot does not have."""
        self._places: Dict[str, Tuple[int, NDArray[np.uint8]]] = {}  # index in hello, and where its image goes
        self._shown: Dict[str, int] = {}  # images since the reset
        if len(cameras) > _MAX_CAMERAS:
            raise ValueError(f"{len(cameras)} cameras; a world has at most {_MAX_CAMERAS}")
        for i, declared in enumerate(hello["cameras"][:int(hello["camera_count"])]):
            camera = declared["name"].decode()
            shape = (int(declared["height"]), int(declared["width"]), int(declared["channels"]))
            if camera not in cameras or tuple(cameras[camera]) != shape:
                continue
            place = (np.ndarray(shape, np.uint8, self._memory, int(declared["offset"])) if self._gives & _SHARED_MEMORY else np.zeros(shape, np.uint8))
            self._places[camera] = (i, place)

    def _views(self) -> None:
        """Arrays over one buffer for each message, made once: a step allocates nothing of its own."""
        count = self._count
        self._question = bytearray(_STEP_TYPE.itemsize)
        self._answer = np.zeros((), _STATE_TYPE)
        step, reset = np.frombuffer(self._question, _STEP_TYPE, 1), np.frombuffer(self._question, _RESET_TYPE, 1)
        self._drive = Drive(step["torque"][0, :count], step["viscous"][0, :count], step["coulomb"][0, :count], step["push"][0], step["hangs"][0:1].reshape(()))
        self._home = reset["q"][0, :count]
        self._q, self._dq = self._answer["q"][:count], self._answer["dq"][:count]
        self._answer_bytes = self._answer.reshape(1).view(np.uint8).data

    def _receive(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            piece = self._peer.recv(size - len(data))
            if not piece:
                raise _Gone
            data += piece
        return data

    def _ask(self) -> Tuple[int, int]:
        """Waits for Takt's next message and copies it; returns kind and sequence."""
        if self._gives & _SHARED_MEMORY:
            self._receive(1)
            self._question[:] = self._memory[:len(self._question)]
        else:
            head = self._receive(_HEADER_STRUCT.size)
            size = _HEADER_STRUCT.unpack(head)[0]
            if not _HEADER_STRUCT.size <= size <= len(self._question):
                raise _Gone
            self._question[:size] = head + self._receive(size - len(head))
        _, kind, _, sequence = _HEADER_STRUCT.unpack_from(self._question)
        return kind, sequence

    def _say(self, state: State, sequence: int, time_ns: int) -> None:
        _HEADER_STRUCT.pack_into(self._answer_bytes, 0, len(self._answer_bytes), _STATE, _PROTOCOL, sequence)
        images = self._headed(state.images, time_ns) if state.images else []
        _OUTCOME_STRUCT.pack_into(self._answer_bytes, _HEADER_STRUCT.size, time_ns, state.outcome, len(images))
        self._q[:], self._dq[:] = state.q, state.dq
        if state.point is not None:
            self._answer["point"] = state.point
        if state.imu is not None:
            self._answer["orientation"] = state.imu.orientation
            self._answer["angular_velocity"] = state.imu.angular_velocity
            self._answer["acceleration"] = state.imu.acceleration
        if state.base is not None:
            self._answer["base_position"] = state.base.position
            self._answer["base_orientation"] = state.base.orientation
        if state.error is not None:
            self._answer["error"] = state.error
        if state.sensor is not None:
            self._answer["sensor"][:self._values] = state.sensor
            self._samples += 1
            self._answer["sensor_sequence"] = self._samples
        if state.reason:
            self._answer["reason"] = state.reason.encode()[:127]
        if self._gives & _SHARED_MEMORY:
            if images:
                heads = b"".join(head for head, _ in images)
                self._memory[_IMAGES_OFFSET:_IMAGES_OFFSET + len(heads)] = heads
            self._memory[_ANSWER_OFFSET:_ANSWER_OFFSET + len(self._answer_bytes)] = self._answer_bytes
            self._peer.sendall(b"\1")
        else:
            self._peer.sendall(self._answer_bytes)
            for head, pixels in images:
                self._peer.sendall(head)
                self._peer.sendall(pixels.data)

    def _headed(self, images: Mapping[str, Image], time_ns: int) -> Sequence[Tuple[bytes, NDArray[np.uint8]]]:
        """What is said of each image, and its place, where it lies afterwards."""
        headed = []
        for camera, image in images.items():
            if camera not in self._places:
                raise ValueError(f"an image of {camera}, which is none of the cameras of serve()")
            index, place = self._places[camera]
            if image.pixels is not place:
                pixels = np.asarray(image.pixels)
                if pixels.shape != place.shape or pixels.dtype != place.dtype:
                    raise ValueError(f"an image of {camera} is {pixels.dtype} {pixels.shape}, expected uint8 {place.shape}")
                place[:] = pixels
            sensed_ns = time_ns - round(image.age * 1e9)
            if not 0 <= sensed_ns <= time_ns:
                raise ValueError(f"an image of {camera} sensed {image.age} s before {time_ns * 1e-9} s of simulation")
            self._shown[camera] = self._shown.get(camera, 0) + 1
            headed.append((_IMAGE_STRUCT.pack(index, place.size, self._shown[camera], sensed_ns), place))
        return headed

    def play(self, world: World) -> None:
        while True:
            kind, sequence = self._ask()
            time_ns = 0
            try:
                if kind == _RESET:
                    self._samples = self._answer["sensor_sequence"] = 0
                    self._shown.clear()
                    (seed,) = struct.unpack_from("<Q", self._question, _HEADER_STRUCT.size)
                    state = world.reset(self._robot, seed, self._home)
                else:
                    begin_ns, step_ns = _AFTER_HEADER.unpack_from(self._question, _HEADER_STRUCT.size)
                    time_ns = begin_ns + step_ns
                    state = world.step(self._drive, step_ns * 1e-9)
                self._say(state, sequence, time_ns)
            except (_Gone, ConnectionError):
                raise
            except Exception as error:  # Takt is told; the world's author sees where it was
                self._say(State(0.0, 0.0, outcome=UNABLE, reason=f"{type(error).__name__}: {error}"), sequence, time_ns)
                raise


__all__: Any = ["FAILED", "RUNNING", "SUCCEEDED", "UNABLE", "Base", "Drive", "Image", "Imu", "Robot", "State", "World", "serve"]
