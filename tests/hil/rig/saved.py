"""Machines saved where they wait for their job, so that a case need not wait for a boot.

Kept beside the image, named by everything that shaped the machine. Only machines in virtual time without further devices:
the boots of the few others are theirs.
"""
from __future__ import annotations

import functools
import hashlib
import pathlib
import socket
import subprocess
import tempfile

from rig.case import Case
from rig.machine import QEMU, WAITS_FOR_JOB, qemu_command

WALL_LIMIT_S = 600
# Not told in what state it was saved, a machine goes on at once.
OPTIONS = ("-global", "migration.store-global-state=off")


class NotSaved(Exception):
    """The machine could not be saved: one sentence."""


@functools.cache
def _path(case: Case, image: pathlib.Path) -> pathlib.Path:
    version = subprocess.run([QEMU, "--version"], check=True, capture_output=True).stdout
    command = qemu_command(case, image, pathlib.Path("job"), "out")
    return image / f"started-{hashlib.sha256(version + repr(command).encode()).hexdigest()[:16]}"


def _begins_saved(case: Case) -> bool:
    return case.mode == "virtual" and case.machine == "plain"


def _save_when_it_waits(guest: socket.socket, console: socket.socket, into: pathlib.Path) -> None:
    guest.settimeout(WALL_LIMIT_S)
    with guest.makefile() as lines:
        if not lines.readline().startswith(WAITS_FOR_JOB):
            raise NotSaved("the guest ended before it waited for a job")
    console.settimeout(WALL_LIMIT_S)
    for command in ("stop", "migrate_set_parameter max-bandwidth 4G", f"migrate \"exec:cat >'{into}'\"", "quit"):
        console.sendall(f"{command}\n".encode())
    with console.makefile(errors="replace") as answers:
        if "Error" in (said := answers.read()):
            raise NotSaved(f"qemu cannot save the guest: {said}")


def _save(case: Case, image: pathlib.Path, into: pathlib.Path) -> None:
    with tempfile.TemporaryDirectory(prefix="takt-hil.") as folder, socket.socket(socket.AF_UNIX) as out, \
            socket.socket(socket.AF_UNIX) as monitor:
        for server, name in ((out, "out"), (monitor, "monitor")):
            server.settimeout(WALL_LIMIT_S)
            server.bind(f"{folder}/{name}")
            server.listen(1)
        command = [*qemu_command(case, image, pathlib.Path(folder), f"{folder}/out"), *OPTIONS, "-monitor", f"unix:{folder}/monitor"]
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL) as qemu:
            try:
                with monitor.accept()[0] as console, out.accept()[0] as guest:
                    _save_when_it_waits(guest, console, into)
                if qemu.wait(WALL_LIMIT_S) != 0:
                    raise NotSaved(f"qemu ended with {qemu.returncode} while it saved the guest")
            except (TimeoutError, subprocess.TimeoutExpired) as problem:
                raise NotSaved(f"the guest did not start within {WALL_LIMIT_S} s") from problem
            finally:
                qemu.kill()


def save_if_missing(case: Case, image: pathlib.Path) -> None:
    if not _begins_saved(case) or _path(case, image).exists():
        return
    for old in image.glob("started-*"):
        old.unlink()
    new = image / "new.started"
    _save(case, image, new)
    new.rename(_path(case, image))


def start_options(case: Case, image: pathlib.Path) -> list[str]:
    """What makes qemu go on with the saved machine; nothing for a case that must boot."""
    return [*OPTIONS, "-incoming", f"exec:cat '{_path(case, image)}'"] if _begins_saved(case) else []
