# SPDX-License-Identifier: Apache-2.0
"""Files of folders that a stranger may have made: regular files only, and no more of them than a reader can bear."""
import json
import mmap
import os
import pathlib
import stat
from typing import Any

from takt._refused import Refused

_LARGEST_JSON = 64 << 20  # bytes


def _opened(path: pathlib.Path) -> int:
    """Never waits for a pipe's other end."""
    try:
        file = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except OSError as error:
        raise Refused(f"{path} cannot be read: {error.strerror}") from None
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise Refused(f"{path} cannot be read: it is not a regular file")
    return file


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
