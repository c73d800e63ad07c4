# SPDX-License-Identifier: Apache-2.0
"""Machines saved where they wait for a job, so that a case need neither wait for a boot nor for an installation.

started-MACHINE-KEY: booted; named by everything that shaped the machine. installed-MACHINE-KEY: the same with the package
installed; named by that and the package. Both beside the image, the newest few of each: rigs of several checkouts share
them. Machines at real pace are not saved.
"""
from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import pathlib
import socket
import subprocess
import tempfile
import threading
from collections.abc import Callable, Iterator

from rig.case import MACHINES, Case
from rig.machine import QEMU, WAITS_FOR_CASE, WAITS_FOR_JOB, qemu_command

WALL_LIMIT_S = 600
KEPT = {"started": 1, "installed": 2}
# Not told in what state it was saved, a machine goes on at once.
OPTIONS = ("-global", "migration.store-global-state=off")


_one_at_a_time = {machine: threading.Lock() for machine in MACHINES}


class NotSaved(Exception):
    """The machine could not be saved: one sentence."""


class NotInstalled(Exception):
    """The guest could not install the package: its words."""


def begins_saved(case: Case) -> bool:
    return case.mode == "virtual"


@functools.cache
def _started(case: Case, image: pathlib.Path) -> pathlib.Path:
    version = subprocess.run([QEMU, "--version"], check=True, capture_output=True).stdout
    command = qemu_command(case, image, pathlib.Path("job"), "out")
    return image / f"started-{case.machine}-{hashlib.sha256(version + repr(command).encode()).hexdigest()[:16]}"


def installed(case: Case, image: pathlib.Path, package_hash: str) -> pathlib.Path:
    key = hashlib.sha256(f"{_started(case, image).name} {package_hash}".encode()).hexdigest()[:16]
    return image / f"installed-{case.machine}-{key}"


def goes_on_from(saved: pathlib.Path) -> list[str]:
    """What makes qemu go on with that machine; it waits for the answer that it waited for."""
    return [*OPTIONS, "-incoming", f"exec:cat '{saved}'"]


def _save_when_it_waits(guest: socket.socket, console: socket.socket, until: str, into: pathlib.Path) -> None:
    guest.settimeout(WALL_LIMIT_S)
    with guest.makefile() as lines:
        said: list[str] = []
        for line in lines:
            if line.startswith(until):
                break
            said.append(line)
        else:
            if until == WAITS_FOR_CASE:
                raise NotInstalled("".join(said).strip() or "the guest ended while it installed")
            raise NotSaved("the guest ended before it waited for a job")
    console.settimeout(WALL_LIMIT_S)
    for command in ("stop", "migrate_set_parameter max-bandwidth 4G", f"migrate \"exec:cat >'{into}'\"", "quit"):
        console.sendall(f"{command}\n".encode())
    with console.makefile(errors="replace") as answers:
        if "Error" in (said_by_qemu := answers.read()):
            raise NotSaved(f"qemu cannot save the guest: {said_by_qemu}")


def _save(case: Case, image: pathlib.Path, job: pathlib.Path, begin: pathlib.Path | None, into: pathlib.Path) -> None:
    """A machine that boots, until it waits for a job; or one that goes on from `begin` with the job, until it waits for a case."""
    with tempfile.TemporaryDirectory(prefix="takt-hil.") as folder, socket.socket(socket.AF_UNIX) as out, \
            socket.socket(socket.AF_UNIX) as monitor:
        for server, name in ((out, "out"), (monitor, "monitor")):
            server.settimeout(WALL_LIMIT_S)
            server.bind(f"{folder}/{name}")
            server.listen(1)
        command = [*qemu_command(case, image, job, f"{folder}/out"), *(goes_on_from(begin) if begin else OPTIONS),
                   "-monitor", f"unix:{folder}/monitor"]
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as qemu:
            try:
                with monitor.accept()[0] as console, out.accept()[0] as guest:
                    if begin:
                        guest.sendall(b"go\n")
                    _save_when_it_waits(guest, console, WAITS_FOR_CASE if begin else WAITS_FOR_JOB, into)
                if qemu.wait(WALL_LIMIT_S) != 0:
                    raise NotSaved(f"qemu ended with {qemu.returncode} while it saved the guest")
            except (TimeoutError, subprocess.TimeoutExpired) as problem:
                raise NotSaved(f"the guest did not come to wait within {WALL_LIMIT_S} s") from problem
            finally:
                qemu.kill()


@contextlib.contextmanager
def _only_one(case: Case, image: pathlib.Path) -> Iterator[None]:
    """Of this process's threads, and of the rigs that share the image."""
    with _one_at_a_time[case.machine], (image / f"lock-{case.machine}").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def _save_if_missing(case: Case, image: pathlib.Path, job: pathlib.Path, begin: pathlib.Path | None, saved: pathlib.Path) -> None:
    if saved.exists():
        return
    kind = saved.name.rpartition("-")[0]
    others = sorted(image.glob(f"{kind}-*"), key=lambda path: path.stat().st_mtime, reverse=True)
    for old in others[KEPT[kind.partition("-")[0]] - 1:]:
        old.unlink()
    new = image / f"new.{kind}"
    _save(case, image, job, begin, new)
    new.rename(saved)


def save_if_missing(case: Case, image: pathlib.Path, make_job: Callable[[], pathlib.Path], package_hash: str) -> None:
    """The machine with the package that the job holds, for a case that begins saved. From any thread."""
    with _only_one(case, image):
        started = _started(case, image)
        saved = installed(case, image, package_hash)
        if not saved.exists():
            job = make_job()
            _save_if_missing(case, image, job, None, started)
            _save_if_missing(case, image, job, started, saved)
        saved.touch()  # in use: the newest
