#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""unit_attempts.py EXECUTIVE MONITOR FALLBACK INTERFACE: what a hostile program tries in the place of a policy host, under its unit: a line for each attempt. The
first three are pids."""
import fcntl
import os
import pathlib
import signal
import socket
import subprocess
import sys

EXECUTIVE, MONITOR, FALLBACK = map(int, sys.argv[1:4])
RUN, RUNS = pathlib.Path("/run/takt"), pathlib.Path("/var/lib/takt/runs")


def tool(*words):
    done = subprocess.run(words, capture_output=True, text=True, timeout=20, check=False)
    if done.returncode != 0:
        raise OSError(done.returncode, (done.stderr.strip() or "refused").splitlines()[-1])


def writes(path):
    with open(path, "r+b"):
        pass


def makes(path):
    with open(path, "xb"):
        pass


def locks(path):
    with open(path, "rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def connects(family, kind, address):
    with socket.socket(family, kind) as one:
        one.settimeout(2)
        one.connect(address)


def sends_frame():
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as one:
        one.bind((sys.argv[4],))
        one.send(bytes(16))


ATTEMPTS = {
    "arm the robot": lambda: tool("takt", "arm", "--runtime-dir", str(RUN)),
    "reset the robot": lambda: tool("takt", "reset", "--runtime-dir", str(RUN)),
    "mark the run": lambda: tool("takt", "mark", "--runtime-dir", str(RUN)),
    "view the run": lambda: tool("takt", "status", "--runtime-dir", str(RUN)),
    "signal the executive": lambda: os.kill(EXECUTIVE, signal.SIGWINCH),
    "stop the monitor": lambda: os.kill(MONITOR, signal.SIGSTOP),
    "kill the fallback policy's host": lambda: os.kill(FALLBACK, signal.SIGKILL),
    "read the executive's memory": lambda: open(f"/proc/{EXECUTIVE}/mem", "rb").close(),
    "read the fallback policy's memory": lambda: open(f"/proc/{FALLBACK}/mem", "rb").close(),
    "see the executive's descriptors": lambda: os.listdir(f"/proc/{EXECUTIVE}/fd"),
    "change the executive's priority": lambda: os.setpriority(os.PRIO_PROCESS, EXECUTIVE, 0),
    "change the executive's processors": lambda: os.sched_setaffinity(EXECUTIVE, {0}),
    "change the monitor's class": lambda: os.sched_setscheduler(MONITOR, os.SCHED_IDLE, os.sched_param(0)),
    "run in real time": lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1)),
    "send a frame": sends_frame,
    "connect by TCP": lambda: connects(socket.AF_INET, socket.SOCK_STREAM, ("127.0.0.1", 22)),
    "open a raw socket": lambda: socket.socket(socket.AF_PACKET, socket.SOCK_RAW).close(),
    "reach the system's bus": lambda: tool("systemctl", "stop", "takt-executive"),
    "read the runs": lambda: os.listdir(RUNS),
    "write the robot file": lambda: writes("/etc/takt/robot/robot.yaml"),
    "make a file in the runtime directory": lambda: makes(RUN / "new"),
    "replace the executive's socket": lambda: os.rename(RUN / "executive.sock", RUN / "other.sock"),
    "hold the runtime directory's lock": lambda: locks(RUN / ".lock"),
    "make a file in /etc": lambda: makes("/etc/new"),
    "make a file at home": lambda: makes("/home/new"),
    "see the home directories": lambda: os.stat("/root/.profile"),
    "open a disk": lambda: open("/dev/vda", "rb").close(),
    "open the memory device": lambda: open("/dev/mem", "rb").close(),
    "change the kernel": lambda: writes("/proc/sys/kernel/panic"),
    "mount": lambda: tool("mount", "-t", "tmpfs", "none", "/mnt"),
    "make namespaces": lambda: tool("unshare", "--user", "true"),
    "become root": lambda: tool("setpriv", "--reuid", "0", "true"),
}
for name, act in ATTEMPTS.items():
    try:
        act()
        print(f"attempt: {name}: got through", flush=True)
    except (OSError, subprocess.SubprocessError) as error:
        print(f"attempt: {name}: refused: {error}", flush=True)
print("attempts: all made", flush=True)
