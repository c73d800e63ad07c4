#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""What fills the disk while a robot is armed: of a run folder, GB a day by file and topic, what other levels and sizes of chunks
would save, and what the columns of /takt/tick hold: the least that each costs as bytes, differences or second differences of its
values, packed apart from the others. The sum is what a record of the same fields at the same rate cannot go below by such means.
Usage: record_bytes.py RUN_FOLDER
Needs python3-numpy and libzstd. Exit codes: 0 done, 64 usage.
"""
import collections
import ctypes
import pathlib
import struct
import sys
import time

import numpy as np

SIZES = {"uint8": 1, "uint16": 2, "uint32": 4, "uint64": 8, "int64": 8, "float32": 4}
SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 3, 4, 5, 6, 7  # records of MCAP
LISTED = 25

zstd = ctypes.CDLL("libzstd.so.1")
for name in ("ZSTD_compressBound", "ZSTD_compress", "ZSTD_decompress"):
    getattr(zstd, name).restype = ctypes.c_size_t


def packed(data, level=1):
    room = zstd.ZSTD_compressBound(ctypes.c_size_t(len(data)))
    return zstd.ZSTD_compress(ctypes.create_string_buffer(room), ctypes.c_size_t(room), bytes(data), ctypes.c_size_t(len(data)), level)


def unpacked(data, size):
    out = ctypes.create_string_buffer(size)
    assert zstd.ZSTD_decompress(out, ctypes.c_size_t(size), bytes(data), ctypes.c_size_t(len(data))) == size
    return out.raw


def text(data, at):
    length, = struct.unpack_from("<I", data, at)
    return data[at + 4:at + 4 + length].decode(), at + 4 + length


def records(data, at):
    while at + 9 <= len(data):
        size, = struct.unpack_from("<Q", data, at + 1)
        yield data[at], data[at + 9:at + 9 + size]
        at += 9 + size


class Run:
    """The chunks, channels and schemas of a ticks.mcap."""

    def __init__(self, data):
        self.topics, self.schemas, self.chunks, self.index_bytes, times = {}, {}, [], 0, []
        for kind, body in records(data, 8):
            if kind == SCHEMA:
                _, at = text(body, 2)
                _, at = text(body, at)
                self.schemas[struct.unpack_from("<H", body)[0]] = text(body, at)[0]
            elif kind == CHANNEL:
                self.topics[struct.unpack_from("<H", body)[0]] = text(body, 4)[0]
            elif kind == MESSAGE_INDEX:
                self.index_bytes += 9 + len(body)
            elif kind == CHUNK:
                first, last, size, _ = struct.unpack_from("<QQQI", body)
                _, at = text(body, 28)
                self.chunks.append(unpacked(body[at + 8:], size))
                times += [first, last]
        self.seconds = (max(times) - min(times)) * 1e-9

    def messages(self):
        for chunk in self.chunks:
            for kind, body in records(chunk, 0):
                if kind == MESSAGE:
                    yield struct.unpack_from("<H", body)[0], body


def columns(schema, message):
    """(name, type, place in the message) of every value."""
    at, found = 0, []
    for line in schema.splitlines():
        line = line.split("#")[0].strip()
        if not line or "=" in line:
            continue
        kind, name = line.split()
        count, is_list, kind = 1, kind.endswith("[]"), kind.removesuffix("[]")
        if is_list:
            at = (at + 3) // 4 * 4
            count, = struct.unpack_from("<I", message, 4 + at)
            at += 4
        size = SIZES[kind]
        at = (at + size - 1) // size * size
        found += [(name, size, 4 + at + i * size) for i in range(count)]
        at += size * count
    return found


def least(values, size):
    best, series = None, values
    for _ in range(3):
        cost = packed(series.view(np.uint8).reshape(-1, size).T.tobytes(), 9)
        best = cost if best is None else min(best, cost)
        series = np.diff(series, prepend=series[:1])
    return best


def main():
    if len(sys.argv) != 2:
        print(__doc__, file=sys.stderr)
        return 64
    folder = pathlib.Path(sys.argv[1])
    run = Run((folder / "ticks.mcap").read_bytes())
    a_day = 86_400e-9 / run.seconds
    for name in ("ticks.mcap", "can.log.zst"):
        print(f"{name:<28}{(folder / name).stat().st_size * a_day:6.2f} GB a day")
    print(f"{'  indexes of messages':<28}{run.index_bytes * a_day:6.2f}")
    by_topic = collections.defaultdict(list)
    for channel, body in run.messages():
        by_topic[channel].append(body)
    for channel, bodies in sorted(by_topic.items()):
        print(f"{'  ' + run.topics[channel]:<28}{packed(b''.join(bodies)) * a_day:6.2f}  packed apart, {len(bodies)} messages")
    for level in (1, 3, 6, 9):
        began = time.process_time()
        size = sum(packed(chunk, level) for chunk in run.chunks)
        took = time.process_time() - began
        print(f"level {level}: {size * a_day:6.2f} GB a day, {100 * took / run.seconds:.2f} % of a processor; "
              f"one chunk of all: {packed(b''.join(run.chunks), level) * a_day:6.2f}")
    tick = next(channel for channel, name in run.topics.items() if name == "/takt/tick")
    bodies = [body[22:] for body in by_topic[tick]]
    size = collections.Counter(map(len, bodies)).most_common(1)[0][0]
    table = np.frombuffer(b"".join(body for body in bodies if len(body) == size), np.uint8).reshape(-1, size)
    costs, seen = collections.Counter(), set()
    for name, width, at in columns(run.schemas[tick], table[0].tobytes()):
        column = np.ascontiguousarray(table[:, at:at + width])
        if (key := hash(column.tobytes())) not in seen:  # a column like another one costs nothing
            seen.add(key)
            costs[name] += least(column.view(f"<u{width}").ravel(), width) / len(table)
    print(f"columns of /takt/tick apart, at least: {sum(costs.values()):.1f} bytes a tick, {sum(costs.values()) * len(table) * a_day:.2f} GB a day")
    for name, cost in costs.most_common(LISTED):
        print(f"  {name:<26}{cost:6.2f} bytes a tick {cost * len(table) * a_day:6.2f} GB a day")
    return 0


if __name__ == "__main__":
    sys.exit(main())
