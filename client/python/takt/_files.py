# SPDX-License-Identifier: Apache-2.0
"""Files of folders that a stranger may have made: regular files only, and no more of them than a reader can bear."""
import errno
import json
import mmap
import os
import pathlib
import stat
from typing import Any

from takt._refused import Refused

_LARGEST_JSON = 64 << 20  # bytes
_UNPAID, _LARGEST_RATIO = 64 << 20, 64  # bytes, and bytes to one on the medium, which may compress: as monitor/record/holes.hpp has them


def _opened(path: pathlib.Path) -> int:
    """Never waits for a pipe's other end."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError as error:
        raise Refused(f"{path} cannot be read: {error.strerror}") from None
    entry = os.fstat(file)
    if not stat.S_ISREG(entry.st_mode) or _is_mostly_holes(file, entry):
        os.close(file)
        raise Refused(f"{path} cannot be read: {'most of it are holes' if stat.S_ISREG(entry.st_mode) else 'it is not a regular file'}")
    return file


def _is_mostly_holes(file: int, entry: os.stat_result) -> bool:
    if entry.st_size <= _UNPAID:
        return False
    if entry.st_blocks > 0:
        return entry.st_size > _LARGEST_RATIO * 512 * entry.st_blocks
    try:
        os.lseek(file, 0, os.SEEK_DATA)
    except OSError as error:
        return error.errno == errno.ENXIO
    return False


def mapped(path: pathlib.Path) -> memoryview:
    """The bytes of a file, however large: only what is looked at takes memory."""
    file = _opened(path)
    try:
        return memoryview(mmap.mmap(file, 0, access=mmap.ACCESS_READ) if os.fstat(file).st_size else b"")
    finally:
        os.close(file)


def text_of(path: pathlib.Path) -> str:
    try:
        return bytes(mapped(path)).decode()
    except UnicodeDecodeError:
        raise Refused(f"{path} cannot be read: it is not UTF-8") from None


def json_of(path: pathlib.Path) -> Any:
    data = mapped(path)
    if len(data) > _LARGEST_JSON:
        raise Refused(f"{path} cannot be read: it is larger than 64 MiB")
    try:
        return json.loads(bytes(data))
    except RecursionError:
        raise Refused(f"{path} cannot be read: it is nested too deeply") from None
    except ValueError as error:
        raise Refused(f"{path} cannot be read: {error}") from None
