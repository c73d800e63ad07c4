#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a policy is a stranger: beside a live robot it can answer observations, and nothing else. Method: `takt run` with a policy in Python that tracks the demo
arm and meanwhile tries what a hostile program tries, each attempt printed with its outcome; what it left behind is looked for afterwards; and the same with what
the command line grants, without a boundary too, so that each attempt is known to be one. Usage: policy_boundary_test.py SOURCE_DIR BUILD_DIR [--table]: a table
of the attempts as root and as another user, with Landlock and without (a filter refuses its calls), for root; exit code 1 where one got through.
"""
import ctypes
import errno
import os
import pathlib
import re
import socket
import struct
import subprocess
import sys
import unittest

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "client")]
from python_rig import PythonRig  # noqa: E402

WITHOUT_LANDLOCK = (sys.executable, str(pathlib.Path(__file__).resolve()), *sys.argv[1:3], "--without-landlock")
MARK = "98765.4321"  # seconds that what is left behind sleeps

HOSTILE = r"""
import ctypes, fcntl, os, pathlib, resource, signal, socket, subprocess, sys, time
import takt

libc = ctypes.CDLL(None, use_errno=True)
here = pathlib.Path.cwd()
runtime = next(here.glob("takt/*/executive.sock"), None) or next(here.rglob("executive.sock"))
runtime = runtime.parent


def pid_of(program):
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            command = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if command[0].endswith(program.encode()) and os.fsencode(runtime) in command:
            return int(entry.name)
    raise SystemExit(f"no {program}")


def call(number, *arguments):
    whole = [ctypes.c_long(one) if isinstance(one, int) else one for one in arguments]
    if libc.syscall(number, *whole) == -1:
        error = ctypes.get_errno()
        raise OSError(error, os.strerror(error))


def tool(*arguments):
    done = subprocess.run(["takt", *arguments, "--runtime-dir", str(runtime)], capture_output=True, text=True, timeout=20)
    if done.returncode != 0:
        raise OSError(0, done.stderr.strip().splitlines()[-1] if done.stderr.strip() else f"exit {done.returncode}")


def opens(path, mode):
    with open(path, mode):
        pass


def memory(pid, mode):
    address = next(line.split("-")[0] for line in open(f"/proc/{pid}/maps") if " rw-p " in line)
    with open(f"/proc/{pid}/mem", mode, buffering=0) as file:
        file.seek(int(address, 16))
        file.read(8) if mode == "rb" else file.write(file.read(8))


def reads_by_call(pid):
    address = int(next(line.split("-")[0] for line in open(f"/proc/{pid}/maps") if " rw-p " in line), 16)
    room = ctypes.create_string_buffer(8)
    vector = (ctypes.c_void_p * 2)(ctypes.addressof(room), 8)
    remote = (ctypes.c_void_p * 2)(address, 8)
    call(310, pid, vector, 1, remote, 1, 0)


def lock(path):
    with open(path, "rb") as file:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def tcp():
    socket.create_connection(("127.0.0.1", int(os.environ["TAKT_TEST_PORT"])), 2).close()


def udp():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.sendto(b"x", ("127.0.0.1", int(os.environ["TAKT_TEST_PORT"])))


def abstract():
    with socket.socket(socket.AF_UNIX) as one:
        one.connect("\0" + os.environ["TAKT_TEST_ABSTRACT"])


def child_in_namespaces():
    child = libc.syscall(56, 0x10000000 | signal.SIGCHLD, 0, 0, 0, 0)
    if child == 0:
        os._exit(0)
    if child < 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def service():
    with socket.socket(socket.AF_UNIX) as one:
        one.connect(os.environ["TAKT_TEST_SERVICE"])


def loopback_bus():
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as one:
        one.connect(str(next(runtime.glob("can-*.sock"))))


def lease():
    with open(here / "robot.yaml", "rb") as file:
        fcntl.fcntl(file, fcntl.F_SETLEASE, fcntl.F_RDLCK)


def pidfd(pid, number):
    file = os.pidfd_open(pid)
    signal.pidfd_send_signal(file, number)


def to_ordinary_class(pid):
    thread = next(int(one) for one in os.listdir(f"/proc/{pid}/task") if os.sched_getscheduler(int(one)) != os.SCHED_OTHER)
    before = os.sched_getscheduler(thread)
    os.sched_setscheduler(thread, os.SCHED_OTHER, os.sched_param(0))
    if os.sched_getscheduler(thread) == before:
        raise PermissionError("told that it is done, and nothing changed")


def tries():
    executive, monitor = pid_of("takt-executive"), pid_of("takt-monitor")
    yield "arm the robot", lambda: tool("arm")
    yield "reset the robot", lambda: tool("reset")
    yield "mark the run", lambda: tool("mark")
    yield "trace the executive", lambda: call(101, 0x4206, executive, 0, 0)
    yield "read the executive's memory", lambda: memory(executive, "rb")
    yield "write the executive's memory", lambda: memory(executive, "r+b")
    yield "read the executive's memory by a call", lambda: reads_by_call(executive)
    yield "signal the executive", lambda: os.kill(executive, signal.SIGWINCH)
    yield "signal the monitor by a descriptor", lambda: pidfd(monitor, signal.SIGWINCH)
    yield "stop the monitor", lambda: (os.kill(monitor, signal.SIGSTOP), os.kill(monitor, signal.SIGCONT))
    yield "change the executive's priority", lambda: os.setpriority(os.PRIO_PROCESS, executive, os.getpriority(os.PRIO_PROCESS, executive))
    yield "change the priority of all of its user's", lambda: os.setpriority(os.PRIO_USER, 0, os.getpriority(os.PRIO_USER, 0))
    yield "change the executive's processors", lambda: os.sched_setaffinity(executive, os.sched_getaffinity(executive))
    yield "take the executive's real time", lambda: to_ordinary_class(executive)
    yield "change the monitor's scheduling class", lambda: os.sched_setscheduler(monitor, os.SCHED_IDLE, os.sched_param(0))
    yield "change the monitor's limits", lambda: resource.prlimit(monitor, resource.RLIMIT_CORE, resource.prlimit(monitor, resource.RLIMIT_CORE))
    yield "run in real time", lambda: os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
    yield "enter the executive's namespaces", lambda: call(308, os.open(f"/proc/{executive}/ns/net", os.O_RDONLY), 0)
    yield "connect by TCP", tcp
    yield "send by UDP", udp
    yield "connect to an abstract socket", abstract
    yield "connect to a service of its user's", service
    yield "connect to the loopback bus", loopback_bus
    yield "open a CAN socket", lambda: socket.socket(socket.AF_CAN, socket.SOCK_RAW, 1).close()
    yield "open a socket to the machine below", lambda: socket.socket(40, socket.SOCK_STREAM).close()
    yield "change the mode of the robot file", lambda: os.chmod(here / "robot.yaml", 0o644)
    yield "change the times of the robot file", lambda: os.utime(here / "robot.yaml")
    yield "lease the robot file", lease
    yield "write the record", lambda: opens(here / "run/ticks.mcap", "r+b")
    yield "remove the record", lambda: os.rename(here / "run/ticks.mcap", here / "run/ticks.gone")
    yield "move the run folder", lambda: os.rename(here / "run", here / "gone")
    yield "write the robot file", lambda: opens(here / "robot.yaml", "r+b")
    yield "make a file beside the robot file", lambda: opens(here / "new", "xb")
    yield "make a file in the runtime directory", lambda: opens(runtime / "new", "xb")
    yield "make a file in /tmp", lambda: opens(f"/tmp/takt-boundary-{os.getpid()}", "xb")
    yield "replace the executive's socket", lambda: os.rename(runtime / "executive.sock", runtime / "other.sock")
    yield "write a file of its own log's", lambda: opens(runtime / "logs/takt-policy-host.log", "r+b")
    yield "lock the runtime directory", lambda: lock(runtime / ".lock")
    yield "mount", lambda: call(165, b"none", b"/mnt", b"tmpfs", 0, None)
    yield "start a child in namespaces", child_in_namespaces
    yield "load a BPF program", lambda: call(321, 5, ctypes.create_string_buffer(128), 128)
    yield "add a key", lambda: call(248, b"user", b"takt", b"x", 1, -2)
    yield "count the machine's events", lambda: call(298, (ctypes.c_uint32 * 32)(1, 128), 0, -1, -1, 0)
    yield "make an io_uring", lambda: call(425, 1, ctypes.create_string_buffer(120))
    yield "make namespaces", lambda: call(272, 0x10000000)


spec = takt.Policy(observation={"q": takt.joints("q"), "dq": takt.joints("dq"), "target": takt.stream("target", 3)}, action=takt.chunk("q", steps=16, step="10 ms"))
with takt.connect("robot.yaml", spec) as robot:
    left = None
    subprocess.Popen(["setsid", "-f", "sleep", os.environ["TAKT_TEST_MARK"]])
    for obs in robot:
        with obs.infer():
            pass
        obs.publish(q=[list(robot.home)] * 16)
        if left is None:
            only = os.environ.get("TAKT_TEST_ONLY")
            left = (one for one in tries() if not only or one[0] in only.split("|"))
        attempt = next(left, None)
        if attempt is None:
            continue
        name, act = attempt
        try:
            act()
            print(f"attempt: {name}: got through", flush=True)
        except (OSError, subprocess.SubprocessError, StopIteration) as error:
            print(f"attempt: {name}: refused: {error}", flush=True)
"""
ATTEMPTS = HOSTILE.count("    yield ")

# A child's child becomes one of `takt run` when its parent has ended.
ORPHANS = r"""
import os, pathlib, subprocess
import takt

def ended_and_kept():
    states = []
    for entry in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            states.append(entry.read_text().rpartition(")")[2].split()[:2])
        except OSError:
            pass
    return sum(state == "Z" and int(parent) == os.getppid() for state, parent in states)

spec = takt.Policy(observation={"q": takt.joints("q"), "dq": takt.joints("dq"), "target": takt.stream("target", 3)}, action=takt.chunk("q", steps=16, step="10 ms"))
with takt.connect("robot.yaml", spec) as robot:
    for number, obs in enumerate(robot):
        with obs.infer():
            pass
        obs.publish(q=[list(robot.home)] * 16)
        if number < 40:
            subprocess.run(["sh", "-c", "sleep 0.01 &"])
        print(f"kept: {ended_and_kept()}", flush=True)
"""


def left_behind():
    return subprocess.run(["pgrep", "-f", f"sleep {MARK}"], capture_output=True, text=True, check=False).stdout.split()


class Boundary(PythonRig):
    def setUp(self):
        super().setUp()
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.addCleanup(self.listener.close)
        self.abstract = socket.socket(socket.AF_UNIX)
        self.addCleanup(self.abstract.close)
        name = f"takt-boundary-test-{os.getpid()}"
        self.abstract.bind("\0" + name)
        self.abstract.listen()
        service = self.enterContext(socket.socket(socket.AF_UNIX))
        service.bind(str(self.folder / "service.sock"))
        service.listen()
        self.environment.update(TAKT_TEST_SERVICE=str(self.folder / "service.sock"), TAKT_TEST_PORT=str(self.listener.getsockname()[1]), TAKT_TEST_ABSTRACT=name, TAKT_TEST_MARK=MARK)
        self.policy(HOSTILE)
        self.addCleanup(lambda: [os.kill(int(pid), 9) for pid in left_behind()])

    def outcomes(self, *grants, only=(), behind=()):
        self.environment["TAKT_TEST_ONLY"] = "|".join(only)
        done = self.command(*behind, "takt", "run", "robot.yaml", "--policy-host", "./policy.py", "--arm", "--duration", "9s", "--run-dir", "run",
                            *(word for grant in grants for word in ("--policy-may", grant)))
        logs = [path for path in self.folder.rglob("takt-policy-host.log")]
        log = logs[0].read_text() if logs else ""
        found = dict(re.findall(r"^attempt: (.*?): (got through|refused.*)$", log, re.M))
        return done, found, log

    # Threat: policy-as-operator
    def test_nothing_gets_through(self):
        done, found, log = self.outcomes()
        self.assertEqual(len(found), ATTEMPTS, log)
        if "not real time" not in done.stdout:  # elsewhere a busy machine stops it too
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr + log)
        self.assertEqual({name: said for name, said in found.items() if said == "got through"}, {}, log)
        self.assertIn("tracking", done.stdout)
        self.assertNotIn("warning: takt-policy-host", done.stdout + done.stderr)
        self.assertEqual(left_behind(), [])
        print("\n".join(f"{name}: {said}" for name, said in found.items()))

    def test_nothing_gets_through_without_landlock(self):
        done, found, log = self.outcomes(behind=WITHOUT_LANDLOCK)
        self.assertEqual(len(found), ATTEMPTS, done.stdout + done.stderr + log)
        self.assertEqual({name: said for name, said in found.items() if said == "got through"}, {}, log)

    def test_what_it_left_and_has_ended_leaves_the_process_table(self):
        self.policy(ORPHANS)
        done, _, log = self.outcomes()
        kept = [int(count) for count in re.findall(r"^kept: (\d+)$", log, re.M)]
        self.assertGreater(len(kept), 60, done.stdout + done.stderr + log)
        self.assertLess(min(kept[50:]), 5, kept)

    # Threat: policy-grants
    def test_what_is_granted_works_and_no_more(self):
        (self.folder / "out").mkdir()
        _, found, log = self.outcomes("network", "write=out")
        granted = {name for name, said in found.items() if said == "got through"}
        self.assertEqual(granted, {"connect by TCP", "send by UDP"}, log)
        self.assertEqual(self.outcomes("write=nowhere")[0].returncode, 64)

    def test_without_a_boundary_they_are_attempts_indeed(self):
        harmless = {"mark the run", "signal the executive", "signal the monitor by a descriptor", "stop the monitor", "connect by TCP", "send by UDP",
                    "connect to an abstract socket", "connect to a service of its user's", "connect to the loopback bus", "change the mode of the robot file",
                    "lease the robot file", "write the record", "make a file beside the robot file", "make a file in the runtime directory",
                    "make a file in /tmp", "write the robot file", "lock the runtime directory"}
        _, found, log = self.outcomes("everything", only=harmless)
        self.assertEqual({name for name, said in found.items() if said == "got through"}, harmless, log)
        for file in pathlib.Path("/tmp").glob("takt-boundary-*"):
            file.unlink()

    def table(self):
        columns = {}
        for user, words in (("root", ()), ("user", ("setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"))):
            for landlock, behind in (("with", ()), ("without", WITHOUT_LANDLOCK)):
                self.doCleanups()
                self.setUp()
                for path in (pathlib.Path(self.python_home), self.folder, *self.folder.iterdir()):
                    os.chown(path, 65534 if words else 0, 65534 if words else 0)
                done, found, log = self.outcomes(behind=(*behind, *words))
                self.assertEqual(len(found), ATTEMPTS, done.stdout + done.stderr + log)
                columns[f"{user}, {landlock} Landlock"] = found
        print("| attempt |", " | ".join(columns), "|\n|---|" + "---|" * len(columns))
        for name in next(iter(columns.values())):
            print("|", name, "|", " | ".join(re.sub(r"^refused: (\[Errno -?\d+\] )?|: '.*", "", found[name])[:60] for found in columns.values()), "|")
        for column, found in columns.items():
            self.assertEqual([name for name, said in found.items() if said == "got through"], [], column)


def without_landlock(command):
    """Becomes the command, whose kernel knows no landlock_create_ruleset (444) any more."""
    filters = [(0x20, 0, 0, 0), (0x15, 0, 1, 444), (0x06, 0, 0, 0x00050000 | errno.ENOSYS), (0x06, 0, 0, 0x7FFF0000)]
    code = ctypes.create_string_buffer(b"".join(struct.pack("<HBBI", *one) for one in filters))
    program = struct.pack("<HxxxxxxQ", len(filters), ctypes.addressof(code))
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(38, 1, 0, 0, 0) != 0 or libc.prctl(22, 2, ctypes.create_string_buffer(program)) != 0:
        raise OSError(ctypes.get_errno(), "no filter")
    os.execvp(command[0], command)


if __name__ == "__main__":
    if "--without-landlock" in sys.argv:
        without_landlock(sys.argv[sys.argv.index("--without-landlock") + 1:])
    if "--table" in sys.argv:
        sys.exit(0 if unittest.TextTestRunner().run(unittest.TestSuite([Boundary("table")])).wasSuccessful() else 1)
    sys.exit(0 if unittest.main(argv=[sys.argv[0]], exit=False, verbosity=2).result.wasSuccessful() else 1)
