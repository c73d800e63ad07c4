# SPDX-License-Identifier: Apache-2.0
"""The emulated computer: how qemu is started for a case, and that it never outlives the rig.

virtual: one CPU, time advances by executed instructions (1 ns each) and leaps over idleness. The same on any host,
however busy. paced: two CPUs at the host's pace, for races and affinity; no assertion on time holds there.
The root file system is an NVDIMM in a private copy of the image: nothing is written back, and reading it never waits.
"""
from __future__ import annotations

import dataclasses
import os
import pathlib
import socket
import subprocess
import tempfile
import threading
from collections.abc import Callable, Sequence

from rig.case import Case

QEMU = "qemu-system-x86_64"
# The guest goes on when either was answered.
WAITS_FOR_JOB = "guest: started"
WAITS_FOR_CASE = "guest: installed"  # it had a job without one
MEMORY_MIB = 1024
KERNEL_OPTIONS = ("console=ttyS0 quiet loglevel=4 panic=-1 oops=panic mitigations=off nokaslr clocksource=tsc tsc=reliable "
                  "no_timer_check random.trust_cpu=on audit=0 nmi_watchdog=0 cryptomgr.notests 8250.nr_uarts=1 "
                  "systemd.show_status=false")
# Two emulated CAN buses with two PCI cards (SJA1000) on each; the watchdog of Intel's 6300ESB.
DEVICES = {
    "plain": [],
    "kvaser": [option for bus in ("canbus0", "canbus1")
               for option in ("-object", f"can-bus,id={bus}", *2 * ("-device", f"kvaser_pci,canbus={bus}"))],
    "watchdog": ["-device", "i6300esb", "-action", "watchdog=reset"],
}


@dataclasses.dataclass(frozen=True)
class Ending:
    in_time: bool  # False: it was ended at the wall limit
    cpu_s: float  # processor time, user and system, of qemu: unlike wall time not a matter of how busy the host was


def qemu_command(case: Case, image: pathlib.Path, job: pathlib.Path, output_socket: str) -> list[str]:
    virtual = case.mode == "virtual"
    root = image / "root.ext4"
    return [
        # Should the rig die by SIGKILL, the kernel ends qemu too.
        "setpriv", "--pdeathsig", "KILL", QEMU, "-nodefaults", "-no-user-config", "-machine", "q35,nvdimm=on",
        "-accel", "tcg,tb-size=128" + ("" if virtual else ",thread=multi"),
        *(["-icount", "shift=0,sleep=off"] if virtual else []),
        # Without AVX: emulated, it is many times slower than SSE. With carry-less multiplication: the rings' checksums use it.
        "-cpu", "Westmere,+rdrand", "-smp", "1" if virtual else "2", "-m", f"{MEMORY_MIB}M,slots=2,maxmem=8G",
        "-display", "none", *([] if case.machine == "watchdog" else ["-no-reboot"]),
        "-kernel", str(image / "vmlinux"), "-initrd", str(image / "initrd"), "-append", KERNEL_OPTIONS,
        "-serial", f"file:{job}/console.log",
        "-object", f"memory-backend-file,id=root,mem-path={root},size={root.stat().st_size},share=off,readonly=off",
        "-device", "nvdimm,id=nvdimm0,memdev=root,unarmed=off",
        "-fsdev", f"local,id=hil,path={job},security_model=none,multidevs=remap",
        "-device", "virtio-9p-pci,fsdev=hil,mount_tag=hil",
        # A socket: on standard input at its end qemu's port closes, and the guest's writes would block for ever.
        "-device", "virtio-serial-pci,max_ports=4", "-chardev", f"socket,id=out,path={output_socket},server=off",
        "-device", "virtserialport,nr=1,chardev=out,name=hil.out",
        *DEVICES[case.machine],
    ]


def _stream(server: socket.socket, on_line: Callable[[str], None], waits_already: bool) -> None:
    try:
        connection, _ = server.accept()
    except OSError:
        return
    with connection, connection.makefile(encoding="utf-8", errors="replace") as lines:
        if waits_already:
            connection.sendall(b"go\n")
        for line in lines:
            if line.startswith(WAITS_FOR_JOB):
                connection.sendall(b"go\n")
            on_line(line.rstrip("\r\n"))


def _wait(qemu: subprocess.Popen[bytes], wall_limit_s: float) -> Ending:
    late = threading.Event()

    def end() -> None:
        late.set()
        qemu.kill()

    limit = threading.Timer(wall_limit_s, end)
    limit.start()
    _, status, usage = os.wait4(qemu.pid, 0)
    limit.cancel()
    qemu.returncode = os.waitstatus_to_exitcode(status)
    return Ending(not late.is_set(), usage.ru_utime + usage.ru_stime)


def run_machine(case: Case, image: pathlib.Path, job: pathlib.Path, wall_limit_s: float,
                on_line: Callable[[str], None], start: Sequence[str] = ()) -> Ending:
    """Runs the guest to its end, from its boot or, with `start`, from a saved machine. qemu's own words: job/qemu.log."""
    with tempfile.TemporaryDirectory(prefix="takt-hil.") as folder, socket.socket(socket.AF_UNIX) as server:
        server.bind(f"{folder}/out")
        server.listen(1)
        reader = threading.Thread(target=_stream, args=(server, on_line, bool(start)), daemon=True)
        reader.start()
        with open(job / "qemu.log", "wb") as log:
            command = [*qemu_command(case, image, job, f"{folder}/out"), *start]
            qemu = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
            try:
                return _wait(qemu, wall_limit_s)
            finally:
                qemu.kill()
                server.shutdown(socket.SHUT_RDWR)
                reader.join(2)
