# SPDX-License-Identifier: Apache-2.0
"""ONNX files, written node by node: opset 17, float32, one static shape per tensor. A file is a function of what was asked for: no time, no path."""
import struct
from typing import Any, Dict, Iterable, List, Mapping, Sequence, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from takt._refused import Refused

_OPSET, _IR_VERSION = 17, 8
_FLOAT, _INT64 = 1, 7  # TensorProto.DataType
_LARGEST_FILE = (2 << 30) - (1 << 20)  # bytes of a protobuf message

Array = NDArray[Any]
Part = Union[bytes, memoryview]
Attribute = Union[int, float, str, Sequence[int]]


def _varint(value: int) -> bytes:
    value &= (1 << 64) - 1
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes(out) + bytes([value])


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _bytes(field: int, value: Union[bytes, str]) -> bytes:
    data = value.encode() if isinstance(value, str) else value
    return _varint(field << 3 | 2) + _varint(len(data)) + data


def _attribute(name: str, value: Attribute) -> bytes:
    head = _bytes(1, name)
    if isinstance(value, float):
        return head + _varint(2 << 3 | 5) + struct.pack("<f", value) + _number(20, 1)
    if isinstance(value, int):
        return head + _number(3, value) + _number(20, 2)
    if isinstance(value, str):
        return head + _bytes(4, value) + _number(20, 3)
    return head + b"".join(_number(8, one) for one in value) + _number(20, 7)


def _tensor(name: str, values: Array) -> List[Part]:
    """As the graph's initializer. The values are not copied."""
    raw = np.ascontiguousarray(values).reshape(-1).data.cast("B")
    kind = _INT64 if values.dtype == np.int64 else _FLOAT
    head = b"".join(_number(1, extent) for extent in values.shape) + _number(2, kind) + _bytes(8, name) + _varint(9 << 3 | 2) + _varint(len(raw))
    return [_varint(5 << 3 | 2) + _varint(len(head) + len(raw)) + head, raw]


def _value(name: str, shape: Iterable[int]) -> bytes:
    dims = b"".join(_bytes(1, _number(1, extent)) for extent in shape)
    return _bytes(1, name) + _bytes(2, _bytes(1, _number(1, _FLOAT) + _bytes(2, dims)))


class Graph:
    """Nodes in the order in which they are asked for. A tensor is known by its name; constants are float32 but for shapes and indices."""

    def __init__(self) -> None:
        self._nodes: List[bytes] = []
        self._constants: Dict[str, Array] = {}
        self._inputs: List[Tuple[str, Tuple[int, ...]]] = []
        self._outputs: List[Tuple[str, Tuple[int, ...]]] = []
        self._size = 0

    def input(self, name: str, *shape: int) -> str:
        self._inputs.append((name, shape))
        return name

    def output(self, name: str, of: str, *shape: int) -> None:
        self._nodes.append(_bytes(1, of) + _bytes(2, name) + _bytes(4, "Identity"))
        self._outputs.append((name, shape))

    def constant(self, values: Any, name: str = "") -> str:
        """`name`: where more than one node may ask for it; the same name must mean the same values."""
        array = np.asarray(values)
        array = array.astype(np.int64 if array.dtype.kind in "iu" else np.float32)
        key = name or f"constant{len(self._constants)}"
        if key not in self._constants:
            self._constants[key] = array
            self._size += array.nbytes
            if self._size > _LARGEST_FILE:
                raise Refused(f"the network has more than {_LARGEST_FILE >> 20} MiB of weights, and an ONNX file holds 2 GiB")
        return key

    def __contains__(self, constant: str) -> bool:
        return constant in self._constants

    def op(self, kind: str, *inputs: str, **attributes: Attribute) -> str:
        name = f"{kind.lower()}{len(self._nodes)}"
        self._nodes.append(b"".join(_bytes(1, one) for one in inputs) + _bytes(2, name) + _bytes(3, name) + _bytes(4, kind)
                           + b"".join(_bytes(5, _attribute(key, value)) for key, value in sorted(attributes.items())))
        return name

    def affine(self, x: str, gain: Any, shift: Any) -> str:
        """gain * x + shift, which broadcast against x."""
        return self.op("Add", self.op("Mul", x, self.constant(gain)), self.constant(shift))

    def reshape(self, x: str, *shape: int) -> str:
        return self.op("Reshape", x, self.constant(np.array(shape, np.int64)))

    def rows(self, x: str, begin: int, end: int, axis: int) -> str:
        return self.op("Slice", x, *(self.constant(np.array([value], np.int64)) for value in (begin, end, axis)))

    def linear(self, x: str, weight: Array, bias: Array, name: str) -> str:
        """(rows, inputs) -> (rows, outputs), weight (outputs, inputs)."""
        return self.op("Gemm", x, self.constant(weight, name + ".weight"), self.constant(bias, name + ".bias"), transB=1)

    def mish(self, x: str) -> str:
        return self.op("Mul", x, self.op("Tanh", self.op("Softplus", x)))

    def group_norm(self, x: str, shape: Tuple[int, ...], groups: int, gain: str, shift: str, epsilon: float = 1e-5) -> str:
        """Of (batch, channels, ...), which is `shape`; gain and shift are (channels, 1, ...)."""
        ones, zeros = self.constant(np.ones(groups), f"ones{groups}"), self.constant(np.zeros(groups), f"zeros{groups}")
        grouped = self.op("InstanceNormalization", self.reshape(x, shape[0], groups, -1), ones, zeros, epsilon=epsilon)
        return self.op("Add", self.op("Mul", self.reshape(grouped, *shape), gain), shift)

    def file(self, about: Mapping[str, str]) -> List[Part]:
        """The file's bytes, part after part. `about`: its metadata."""
        parts: List[Part] = [b"".join(_bytes(1, node) for node in self._nodes) + _bytes(2, "lerobot")]
        for name, values in self._constants.items():
            parts += _tensor(name, values)
        parts.append(b"".join(_bytes(11, _value(*one)) for one in self._inputs) + b"".join(_bytes(12, _value(*one)) for one in self._outputs))
        head = _number(1, _IR_VERSION) + _bytes(2, "takt.lerobot") + _varint(7 << 3 | 2) + _varint(sum(map(len, parts)))
        properties = b"".join(_bytes(14, _bytes(1, key) + _bytes(2, value)) for key, value in sorted(about.items()))
        return [head, *parts, _bytes(8, _number(2, _OPSET)) + properties]
