# SPDX-License-Identifier: Apache-2.0
"""A sensor of a robot: its samples, written into shared memory in place."""
import argparse
import ctypes
import os
import sys
import time
from typing import Any, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from takt import _library
from takt._refused import Refused

_LARGEST = 2**31 - 1  # of a shape


class Sensor:
    """One of the robot file's `sensors`, served by this process for as long as it is open; use it in a `with` statement.

        with takt.Sensor("force", "robot.yaml", shape=6, unit="N") as force:
            while True:
                force.publish(read(), stamp=time.monotonic_ns())

    `shape` and `dtype` (float32 with one axis; uint8 with three, height x width x channels, for images) and, where it is given,
    `unit` have to be the robot file's, or Refused is raised in one sentence. `--robot` and `--runtime-dir` on this program's command
    line win over `robot_file` and `runtime_dir`. `policy_user`: one more user who may read it, besides this one and root.
    It belongs to the thread that opened it; nothing waits for readers. Refused, 69: another process serves this sensor.
    """

    name: str
    shape: Tuple[int, ...]
    timeout: float  # s; an older sample is not used
    unit: str  # the robot file's; "unstated"

    def __init__(self, name: str, robot_file: Union[str, "os.PathLike[str]"], *, shape: Union[int, Tuple[int, ...]],
                 dtype: DTypeLike = np.float32, unit: Optional[str] = None, runtime_dir: Optional[str] = None,
                 policy_user: Optional[str] = None, arguments: Optional[Sequence[str]] = None) -> None:
        self._pointer = ctypes.c_void_p()
        self.name = name
        self.dtype: "np.dtype[Any]" = np.dtype(dtype)
        self.shape = (shape,) if isinstance(shape, int) else tuple(shape)
        if not all(0 < extent <= _LARGEST for extent in self.shape):
            raise Refused(f"takt.Sensor: shape {shape}: each of its numbers is from 1 to {_LARGEST}", _library.USAGE)
        wanted = self._spec()
        file, directory = place(os.fspath(robot_file), runtime_dir, arguments)
        wanted.robot_file, wanted.name = os.fsencode(file), name.encode()
        wanted.runtime_directory = None if directory is None else os.fsencode(directory)
        wanted.unit = None if unit is None else unit.encode()
        wanted.policy_user = None if policy_user is None else policy_user.encode()
        self._library = _library.load()
        why = ctypes.create_string_buffer(2048)
        if result := self._library.takt_sensor_open(wanted, self._pointer, why, len(why)):
            raise Refused(why.value.decode(errors="replace"), result)
        stream = self._library.takt_sensor_stream(self._pointer).contents
        self.timeout = stream.timeout_ns * 1e-9
        self.unit = stream.unit.decode()

    def _spec(self) -> "_library.SensorSpecStruct":
        spec = _library.SensorSpecStruct(size=ctypes.sizeof(_library.SensorSpecStruct))
        if self.dtype == np.float32 and len(self.shape) == 1:
            spec.type, spec.values = _library.FLOAT32, self.shape[0]
        elif self.dtype == np.uint8 and len(self.shape) == 3:
            spec.type = _library.UINT8
            spec.height, spec.width, spec.channels = self.shape
        else:
            raise Refused(f"takt.Sensor: {self.dtype} of shape {self.shape}: samples are float32 with one axis, or uint8 images with three: "
                          "height, width, channels", _library.USAGE)
        return spec

    def __enter__(self) -> "Sensor":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        """Ends the service. Arrays that `values` gave must not be touched after it."""
        pointer, self._pointer = self._pointer, ctypes.c_void_p()
        if pointer:
            self._library.takt_sensor_close(pointer)

    __del__ = close

    @property
    def values(self) -> NDArray[Any]:
        """The next sample's memory, of the sensor's shape and dtype, to be filled in place: `sensor.values[:] = frame`. It is another
        one after every publish(); what is in it is an earlier sample. Who fills a memory of its own instead, as cv2's read() does where
        shapes differ, has not filled this one: give the image to publish(). Raises Refused once the sensor is closed.
        """
        address = self._library.takt_sensor_values(self._open())
        count = int(np.prod(self.shape)) * self.dtype.itemsize
        return np.frombuffer(memoryview((ctypes.c_ubyte * count).from_address(address)), self.dtype).reshape(self.shape)

    def publish(self, values: Optional[ArrayLike] = None, *, stamp: Optional[int] = None) -> None:
        """Publishes `values`, or, without them, what was written to the memory of the same name. `stamp`: when it was sensed, ns of
        time.monotonic_ns(), now without it; it counts in the age of every command that rests on the sample, so say when the
        shutter was open, not when the image arrived. Raises Refused for another shape, for values that the sensor's type cannot hold
        (an image of floats, a pixel of 300), and for a stamp after now or no whole number of ns.
        """
        if values is not None:
            given = np.asarray(values)
            if given.shape != self.shape:
                raise Refused(f"sensor {self.name}: publish: the shape is {given.shape}, the sensor's {self.shape}", _library.USAGE)
            self.values[...] = self._taken(given)
        if stamp is not None and (not isinstance(stamp, (int, np.integer)) or stamp <= 0):
            raise Refused(f"sensor {self.name}: publish: the stamp is {stamp}: give ns of time.monotonic_ns()", _library.USAGE)
        if result := self._library.takt_sensor_publish(self._open(), time.monotonic_ns() if stamp is None else int(stamp)):
            raise Refused(f"sensor {self.name}: {self._library.takt_sensor_sentence(self._pointer).decode()}", result)

    def _taken(self, given: NDArray[Any]) -> NDArray[Any]:
        # numpy would make zeros of an image from 0 to 1, and 44 of 300.
        if given.dtype == self.dtype:
            return given
        if self.dtype.kind == "u" and given.dtype.kind in "iu":
            lowest, highest = np.iinfo(self.dtype).min, np.iinfo(self.dtype).max
            wrong = given[(given < lowest) | (given > highest)]
            if wrong.size:
                raise Refused(f"sensor {self.name}: publish: {wrong[0]} is no {self.dtype}: values go from {lowest} to {highest}", _library.USAGE)
        elif not np.can_cast(given.dtype, self.dtype, "same_kind"):
            raise Refused(f"sensor {self.name}: publish: {given.dtype} cannot become {self.dtype} without loss: give {self.dtype}"
                          + (", of an image from 0 to 1 the 255-fold, rounded" if self.dtype.kind == "u" and given.dtype.kind == "f" else ""), _library.USAGE)
        elif np.any(np.isfinite(given) & (np.abs(given) > np.finfo(np.float32).max)):
            raise Refused(f"sensor {self.name}: publish: {np.max(np.abs(given))} is more than float32 holds", _library.USAGE)
        return given

    def _open(self) -> ctypes.c_void_p:
        if not self._pointer:
            raise Refused(f"sensor {self.name}: it is closed", _library.USAGE)
        return self._pointer


def place(robot_file: str, runtime_dir: Optional[str], arguments: Optional[Sequence[str]]) -> Tuple[str, Optional[str]]:
    """Robot file and runtime directory: those of the command line, where it has them, as `takt run` gives them."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--robot", default=robot_file)
    parser.add_argument("--runtime-dir", default=runtime_dir)
    given, _ = parser.parse_known_args(sys.argv[1:] if arguments is None else arguments)
    return given.robot, given.runtime_dir
