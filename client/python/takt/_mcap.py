# SPDX-License-Identifier: Apache-2.0
"""The messages of a run's ticks.mcap: chunks of MCAP, bodies in CDR, laid out as the file's own ros2msg schemas say."""
import functools
import pathlib
import re
import zlib
from dataclasses import dataclass
from typing import Any, Callable, Dict, Iterator, List, Tuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from takt import _files
from takt._refused import Refused

_TYPES = {"uint8": "u1", "uint16": "<u2", "uint32": "<u4", "uint64": "<u8", "int64": "<i8", "float32": "<f4"}
_SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 3, 4, 5, 6
_MAGIC = b"\x89MCAP0\r\n"
_BODY = 22  # of a message record, behind channel, sequence and two times
_LARGEST_CHUNK, _LARGEST_RATIO = 64 << 20, 1000  # bytes, and bytes to a byte of the file: as McapReader has them
_FREE, _LARGEST_TOTAL_RATIO, _RECORD = 8 << 20, 100, 512  # of all chunks together; what a record costs beside its bytes
_ENCAPSULATION = 4  # bytes before CDR's own alignment begins


_Made = TypeVar("_Made")


@dataclass(frozen=True)
class Field:
    name: str
    type: str  # of the schema; "string" too
    count: int  # 1; of a fixed array its length; -1: a sequence, with its length before it
    names: Dict[int, str]  # of an enumeration's values
    about: str  # the schema's comment: unit, meaning


def _number(data: memoryview, at: int, size: int) -> int:
    return int.from_bytes(data[at:at + size], "little")


def _records(data: memoryview) -> Iterator[Tuple[int, memoryview]]:
    """Opcode and content; what is cut off at the end is left out."""
    at = 0
    while at + 9 <= len(data):
        size = _number(data, at + 1, 8)
        if at + 9 + size > len(data):
            return
        yield data[at], data[at + 9:at + 9 + size]
        at += 9 + size


def _texts(data: memoryview, at: int, count: int) -> List[bytes]:
    found = []
    for _ in range(count):
        size = _number(data, at, 4)
        found.append(bytes(data[at + 4:at + 4 + size]))
        at += 4 + size
    return found


def _decompressed(data: memoryview, size: int) -> bytes:
    try:
        import zstandard
    except ImportError:
        raise Refused("takt.open needs the Python module zstandard: sudo apt install python3-zstandard") from None
    try:
        return zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
    except zstandard.ZstdError as error:
        raise ValueError(str(error)) from None


def fields_of(schema: str) -> List[Field]:
    """Of a flat ros2msg text. Constants MODE_... name the values of the field `mode`, and of those whose comment says "MODE values"."""
    fields, constants, catalogue = [], {}, {}
    for line in schema.splitlines():
        if constant := re.match(r"\w+ ([A-Z]\w*)=(\d+)", line):
            constants[constant[1]] = int(constant[2])
        elif field := re.match(r"(\w+)(\[(\d*)\])? (\w+)\s*#?\s*(.*)", line):
            own = field[4].upper()
            catalogue[own] = {value: name[len(own) + 1:].lower() for name, value in constants.items() if name.startswith(own + "_")}
            constants = {}
            shared = re.search(r"\b([A-Z_]+) values", field[5])
            count = 1 if field[2] is None else int(field[3] or -1)
            fields.append(Field(field[4], field[1], count, catalogue[shared[1] if shared and shared[1] in catalogue else own], field[5]))
    return fields


def _places(fields: List[Field], body: memoryview) -> Iterator[Tuple[Field, int, int]]:
    """Where each field of this message lies: its first value's offset, and how many there are. Of a text: its bytes."""
    at = 4  # behind the encapsulation
    for field in fields:
        count = field.count
        if field.type == "string" or count < 0:
            at += -(at - _ENCAPSULATION) % 4
            count, at = _number(body, at, 4), at + 4
        size = 1 if field.type == "string" else np.dtype(_TYPES[field.type]).itemsize
        at += -(at - _ENCAPSULATION) % size if count else 0
        yield field, at, count
        at += size * count


def _whole(made: Callable[..., _Made]) -> Callable[..., _Made]:
    """Of what no schema of Takt's describes, one sentence is said."""
    @functools.wraps(made)
    def judged(*arguments: Any) -> _Made:
        try:
            return made(*arguments)
        except (ValueError, KeyError, IndexError, TypeError, OverflowError, MemoryError) as error:
            raise Refused(f"takt.open: messages do not fit their schema ({error}); the file is damaged") from None
    return judged


@_whole
def table(fields: List[Field], bodies: List[memoryview]) -> NDArray[Any]:
    """Messages of one size as one structured array; its sequences are as long as in the first."""
    places = [(field, at, count) for field, at, count in _places(fields, bodies[0])] if bodies else [(field, 0, max(field.count, 1)) for field in fields]
    layout: Any = {"names": [field.name for field, _, _ in places],
                   "formats": [(_TYPES[field.type], (count,)) if field.count != 1 else _TYPES[field.type] for field, _, count in places]}
    if bodies:
        layout.update(offsets=[at for _, at, _ in places], itemsize=len(bodies[0]))
    kind = np.dtype(layout)
    if any(len(body) != kind.itemsize for body in bodies):
        raise Refused("takt.open: ticks of one run differ in size; the file is damaged")
    return np.frombuffer(b"".join(bodies), kind)


@_whole
def rows(fields: List[Field], bodies: List[memoryview]) -> List[Dict[str, Any]]:
    """Messages of any size: numbers, texts, and arrays where the schema has some."""
    found = []
    for body in bodies:
        row: Dict[str, Any] = {}
        for field, at, count in _places(fields, body):
            if field.type == "string":
                row[field.name] = bytes(body[at:at + count - 1]).decode()  # CDR's texts end with a zero
                continue
            values = np.frombuffer(body, _TYPES[field.type], count, at)
            row[field.name] = values if field.count != 1 else values[0].item()
        found.append(row)
    return found


class Recording:
    """Schemas and messages of the file, by topic. `damaged`: parts of it that were left out."""

    def __init__(self, path: pathlib.Path) -> None:
        data = _files.mapped(path)
        if bytes(data[:8]) != _MAGIC:
            raise Refused(f"{path} is no MCAP file")
        self._schemas: Dict[int, str] = {}
        self._topics: Dict[int, str] = {}
        self.fields: Dict[str, List[Field]] = {}
        self.bodies: Dict[str, List[memoryview]] = {}
        self.damaged = 0
        self._left = _FREE + _LARGEST_TOTAL_RATIO * len(data)
        for opcode, content in _records(data[8:]):
            try:
                for inner in _records(self._in_chunk(content)) if opcode == _CHUNK else ((opcode, content),):
                    self._spend(_RECORD if opcode == _CHUNK else 0)
                    self._take(*inner)
            except (ValueError, KeyError):  # a text that is none, a channel without a schema
                self.damaged += 1

    def _spend(self, size: int) -> None:
        if size > self._left:
            raise ValueError("more than the file's bytes can hold")
        self._left -= size

    def _in_chunk(self, chunk: memoryview) -> memoryview:
        """Its records; raises ValueError where they are not what was written."""
        size, checksum = _number(chunk, 16, 8), _number(chunk, 24, 4)
        (compression,) = _texts(chunk, 28, 1)
        stored = chunk[32 + len(compression) + 8:]
        if len(stored) != _number(chunk, 32 + len(compression), 8) or size > min(_LARGEST_CHUNK, _LARGEST_RATIO * len(stored)):
            raise ValueError("more than its bytes can hold")
        if compression not in (b"", b"zstd"):
            raise ValueError("of an unknown compression")
        self._spend(size)
        content = memoryview(_decompressed(stored, size)) if compression else stored
        if len(content) != size or checksum not in (0, zlib.crc32(content)):
            raise ValueError("not what was written")
        return content

    def _take(self, opcode: int, content: memoryview) -> None:
        if opcode == _SCHEMA:
            self._schemas[_number(content, 0, 2)] = _texts(content, 2, 3)[2].decode()
        elif opcode == _CHANNEL:
            topic = _texts(content, 4, 1)[0].decode()
            self._topics[_number(content, 0, 2)] = topic
            if topic not in self.fields:
                self.fields[topic] = fields_of(self._schemas[_number(content, 2, 2)])
            self.bodies.setdefault(topic, [])
        elif opcode == _MESSAGE and (found := self._topics.get(_number(content, 0, 2))) is not None:
            self.bodies[found].append(content[_BODY:])
