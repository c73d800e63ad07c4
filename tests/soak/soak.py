#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: whatever is done to a robot's processes, folders and buses for as long as it takes, no frame leaves that the guard refuses, nothing is left behind,
and its run folders say which ticks they lack. Method: the demo arm under `takt run`, one life after another; in each, faults drawn by a seed come one by one
until one ends it; each life's folders are read, replayed and counted then. At the end one life is left in peace, to see whether memory or descriptors grow.
Usage: soak.py SOURCE_DIR BIN_DIR [--minutes N] [--rest-minutes N] [--seed S]. Exit codes: 0 fine, 1 not.
"""
import argparse
import collections
import contextlib
import json
import os
import pathlib
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "process")]
from operated import Operated  # noqa: E402
from patient import patient  # noqa: E402

PROGRAMS = {"takt-executive": "executive", "takt-monitor": "monitor", "takt-plant": "plant", "takt-policy-host": "policy"}
LONGEST_END = 30.0  # s, from the request to the end of `takt run`
DISK = 96 << 20  # bytes, for a life's folders: a run of a minute takes half of it
MOST_GROWTH = 1 << 20  # bytes, of the life in peace


def proc(pid, name):
    with contextlib.suppress(OSError):
        return pathlib.Path(f"/proc/{pid}/{name}").read_bytes()
    return b""


def resident(pid):
    found = re.search(rb"VmRSS:\s+(\d+) kB", proc(pid, "status"))
    return int(found[1]) * 1024 if found else 0


def descriptors(pid):
    with contextlib.suppress(OSError):
        return len(os.listdir(f"/proc/{pid}/fd"))
    return 0


class Disk:
    """A small file system of its own, where this machine lends one; `large`: a folder of the machine's."""

    def __init__(self, place, large):
        self.place = place
        place.mkdir()
        self.is_small = not large and subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK}", "tmpfs", place], capture_output=True, check=False).returncode == 0

    def fill(self):
        with contextlib.suppress(OSError), open(self.place / "full", "wb") as file:
            while True:
                file.write(bytes(1 << 20))

    def free(self):
        (self.place / "full").unlink(missing_ok=True)

    def close(self):
        if self.is_small:
            subprocess.run(["umount", "-l", self.place], check=False)


class Life:
    """One `takt run`: its processes, its folders, and what went wrong."""

    def __init__(self, soak, number, in_peace=0.0):
        """`in_peace`: for so many seconds, on a bus without faults."""
        self.soak, self.random = soak, soak.random
        self.place = soak.scratch / f"life{number}"
        self.place.mkdir()
        self.disk = Disk(self.place / "disk", large=in_peace > 0)
        self.sockets, self.folder = self.place / "sockets", self.disk.place / "run"
        self.robot = Operated(soak.programs, self.sockets)
        self.wrong, self.faults, self.last_tick = [], [], 0
        self.run = self.robot.start(soak.robot_file, self.folder, *([] if in_peace else [f"--plant=--scenario={self.bus_faults()}"]),
                                    duration=f"{in_peace + 600:.0f}s", start_new_session=True, env=os.environ | {"TAKT_SOAK": str(self.place)})

    def bus_faults(self):
        """A scenario of them."""
        scenario = self.place / "faults.yaml"
        events, at = [], 3.0
        while at < 120:
            at += self.random.uniform(3, 15)
            what = self.random.choice(["fault: babble", "drop: 0.2", "fault: error_passive", "fault: bus_off"])
            events.append(f"  - {{ at: {at:.1f} s, for: {self.random.randint(20, 400)} ms, bus: can0, {what} }}")
        scenario.write_text("schema: takt.scenario/1\nevents:\n" + "\n".join(events) + "\n")
        return scenario

    def processes(self):
        """By name: pid."""
        found = {}
        for entry in os.listdir("/proc"):
            if not entry.isdigit() or f"TAKT_SOAK={self.place}".encode() not in proc(entry, "environ").split(b"\0"):
                continue
            words = proc(entry, "cmdline").split(b"\0")
            name = pathlib.Path(os.fsdecode(words[0])).name
            found[PROGRAMS.get(name, name)] = int(entry)
        return found

    def complain(self, what):
        self.wrong.append(f"life {self.place.name}, after {', '.join(self.faults) or 'nothing'}: {what}")

    def status(self):
        status = self.robot.status()
        self.last_tick = max(self.last_tick, status.get("tick", 0))
        return status

    # Faults: each says what it did, and whether the life may go on.

    def freeze(self):
        name, pid = self.random.choice(sorted(self.processes().items()))
        length = self.random.uniform(0.005, 0.8)
        os.kill(pid, signal.SIGSTOP)
        time.sleep(length)
        os.kill(pid, signal.SIGCONT)
        return f"froze {name} for {1000 * length:.0f} ms", True

    def kill(self):
        name, pid = self.random.choice(sorted(self.processes().items()))
        with_signal = self.random.choice([signal.SIGKILL, signal.SIGHUP, signal.SIGTERM, signal.SIGSEGV])
        os.kill(pid, with_signal)
        return f"{with_signal.name} to {name}", False

    def person(self):
        verb = self.random.choice(["stop", "stop", "reset", "arm", "mark"])
        self.robot.takt(verb, *(["soak"] if verb == "mark" else []), "--runtime-dir", self.sockets)
        return f"takt {verb}", True

    def viewers(self):
        viewers = [subprocess.Popen([self.soak.programs / "takt", "top", "--once", "--runtime-dir", self.sockets], stdout=subprocess.DEVNULL,
                                    stderr=subprocess.DEVNULL) for _ in range(4)]
        for viewer in viewers:
            if self.random.random() < 0.5:
                viewer.kill()
            viewer.wait(timeout=60)
        return "four viewers", True

    def garbage(self):
        for path in self.sockets.rglob("*.sock"):
            for kind in (socket.SOCK_STREAM, socket.SOCK_SEQPACKET, socket.SOCK_DGRAM):
                with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, kind) as one:
                    one.settimeout(0.2)
                    one.connect(str(path))
                    one.send(self.random.randbytes(self.random.randint(1, 4000)))
        return "garbage into every socket", True

    def second(self):
        again = self.robot.start(self.soak.robot_file, self.disk.place / "second", duration="2s")
        code = again.wait(timeout=60)
        if code == 0:
            self.complain("a second `takt run` beside the first ended with 0")
        return "a second takt run", True

    def descriptors_spent(self):
        name, pid = self.random.choice([one for one in sorted(self.processes().items()) if one[0] != "takt"])
        subprocess.run(["prlimit", "--pid", str(pid), f"--nofile={descriptors(pid) + self.random.randint(0, 3)}:"], check=False, capture_output=True)
        return f"few descriptors for {name}", True

    def memory_spent(self):
        name, pid = self.random.choice([one for one in sorted(self.processes().items()) if one[0] in ("monitor", "plant", "policy")])
        whole = int(proc(pid, "statm").split()[0] or 0) * 4096
        subprocess.run(["prlimit", "--pid", str(pid), f"--as={whole + self.random.randint(0, 4 << 20)}:"], check=False, capture_output=True)
        return f"little memory for {name}", True

    def full_disk(self):
        if not self.disk.is_small:
            return "no disk of its own", True
        self.disk.fill()
        time.sleep(self.random.uniform(0.5, 3))
        self.disk.free()
        return "a full disk, then room again", False

    def renamed(self):
        with contextlib.suppress(OSError):
            self.folder.rename(self.folder.with_name("moved"))
            self.folder = self.folder.with_name("moved")
        return "the run folder renamed", False

    def live(self, most):
        """Faults until one ends it, or it does not go on, or `most` seconds are over."""
        until = time.monotonic() + most
        if not self.robot.get_going():
            self.complain("it never tracked")
            return
        mild = [self.freeze] * 4 + [self.person] * 3 + [self.viewers, self.garbage, self.second, self.descriptors_spent, self.memory_spent]
        fatal = [self.kill] * 4 + [self.full_disk, self.renamed]
        goes_on = True
        while goes_on and time.monotonic() < until:
            fault = self.random.choice(fatal if self.random.random() < 0.12 else mild)
            if len(self.processes()) < 5:  # one was refused memory, and is gone: that is an end, too
                break
            try:
                what, goes_on = fault()
            except (ProcessLookupError, IndexError):
                break
            self.faults.append(what)
            self.soak.count(what)
            with contextlib.suppress(subprocess.TimeoutExpired, json.JSONDecodeError, KeyError):
                self.status()
                goes_on = goes_on and self.run.poll() is None and self.robot.wait_until(self.tracks_or_ends, 20) and self.run.poll() is None

    def work_for(self, seconds):
        """In tracking, whatever a busy machine stops."""
        until = time.monotonic() + seconds
        while time.monotonic() < until and self.run.poll() is None:
            self.tracks_or_ends(self.status())
            time.sleep(min(10.0, max(0.0, until - time.monotonic())))

    def tracks_or_ends(self, status):
        self.last_tick = max(self.last_tick, status.get("tick", 0))
        if self.run.poll() is not None:
            return True
        verb = {"damped_stop": "reset", "fault_latched": "reset", "standby": "arm"}.get(status.get("mode"))
        if verb:
            self.robot.ask(verb)
        return status.get("mode") == "tracking"

    def end(self):
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.robot.takt("stop", "--runtime-dir", self.sockets)
        began = time.monotonic()
        if self.run.poll() is None:
            self.run.send_signal(signal.SIGINT)
        try:
            said, _ = self.run.communicate(timeout=LONGEST_END)
        except subprocess.TimeoutExpired:
            self.complain(f"`takt run` was not over {LONGEST_END:.0f} s after it was asked to end")
            os.killpg(self.run.pid, signal.SIGKILL)
            said, _ = self.run.communicate()
        if self.run.returncode < 0 and not any(fault.endswith(" to takt") for fault in self.faults) or self.run.returncode == 70:
            self.complain(f"`takt run` ended with {self.run.returncode}: {said.strip()[-400:]}")
        self.look_for_crashes(said)
        self.look_for_what_is_left(began)
        self.read_folders()
        self.disk.close()
        if not self.wrong:
            shutil.rmtree(self.place, ignore_errors=True)

    def look_for_crashes(self, said):
        (self.place / "said").write_text(said)
        for line in said.splitlines():
            # Who gets no memory ends, and what it did for the robot is missed as if it had been killed.
            starved = any(fault.startswith("little memory") for fault in self.faults) and re.search("SIGABRT|terminate called|bad_alloc", line)
            ours = "SIGSEGV" in line and any("SIGSEGV" in fault for fault in self.faults)
            if re.search(r"Sanitizer|stack smashing|buffer overflow|terminate called|SIG(ABRT|SEGV|BUS|FPE|ILL)", line) and not starved and not ours:
                self.complain(f"`takt run` said: {line} ({self.place / 'said'})")

    def look_for_what_is_left(self, began):
        while (left := self.processes()) and time.monotonic() - began < LONGEST_END:
            time.sleep(0.2)
        if left:
            self.complain(f"left running: {left}")
            for pid in left.values():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        killed = any("SIGKILL" in fault or "SIGSEGV" in fault for fault in self.faults)
        sockets = [str(path) for path in self.sockets.rglob("*.sock")] if self.sockets.exists() else []
        if sockets and not killed:
            self.complain(f"sockets left: {sockets}")

    def read_folders(self):
        for folder in sorted(path for path in self.disk.place.iterdir() if path.is_dir()):
            began = time.monotonic()
            replay = self.robot.takt("replay", folder)
            if replay.returncode not in (0, 1, 2) or not replay.stdout.strip() or time.monotonic() - began > 60:
                self.complain(f"takt replay {folder.name}: {replay.returncode}, {replay.stdout.strip()[-400:]}")
            if replay.returncode == 1 and "nothing to replay" not in replay.stdout:
                self.complain(f"takt replay {folder.name}: {replay.stdout.strip()[-600:]}")
            self.soak.replayed[replay.returncode] += 1
            report = self.robot.takt("report", folder)
            if report.returncode not in (0, 1, 2) or not report.stdout.strip():
                self.complain(f"takt report {folder.name}: {report.returncode}, {report.stdout.strip()[-400:]}")
            # The cause of a frame that the guard refused.
            with contextlib.suppress(OSError):
                if '"internal_error"' in (folder / "transitions.jsonl").read_text():
                    self.complain(f"{folder.name}: the guard refused a frame, or a result was not finite")
            self.count_ticks(folder, replay.stdout)

    def count_ticks(self, folder, said):
        """What was seen to happen is in the folder, or the replay says that it is not."""
        try:
            manifest = json.loads((folder / "manifest.json").read_text())
        except (OSError, json.JSONDecodeError):
            return
        last = manifest.get("ticks", {}).get("last", manifest.get("last_tick", 0))
        # A monitor without a descriptor left closes its files, and no manifest says so.
        if counted := re.match(r"(\d+) of \d+ ticks", said):
            last = max(last, int(counted[1]))
        if folder == self.folder and last + 2000 < self.last_tick and "not in this folder" not in said:
            self.complain(f"{folder.name} ends at tick {last}, tick {self.last_tick} was seen, and the replay says: {said.strip()[-400:]}")


class Soak:
    def __init__(self, source, programs, seed):
        self.programs, self.random = programs, random.Random(seed)
        self.scratch = pathlib.Path(tempfile.mkdtemp(prefix="takt-soak-"))
        (self.scratch / "config").mkdir()
        for file in (source / "config").iterdir():
            if file.is_file():
                shutil.copy(file, self.scratch / "config")
        self.robot_file = self.scratch / "config" / "arm6.yaml"
        self.robot_file.write_text(patient(self.robot_file.read_text()))
        self.kinds, self.replayed = collections.Counter(), collections.Counter()
        self.wrong, self.lives = [], 0

    def count(self, what):
        self.kinds[re.sub(r" for \d+ ms", "", what)] += 1

    def close_life(self, life):
        life.end()
        self.wrong += life.wrong
        for line in life.wrong:
            print(line, flush=True)

    def in_peace(self, seconds):
        """What a robot at work takes after a third of the time and at the end."""
        life = Life(self, "-in-peace", in_peace=seconds)
        if not life.robot.get_going():
            life.complain("it never tracked")
        life.work_for(seconds / 3)
        before = {name: (resident(pid), descriptors(pid)) for name, pid in life.processes().items()}
        life.work_for(2 * seconds / 3)
        after = {name: (resident(pid), descriptors(pid)) for name, pid in life.processes().items()}
        if life.run.poll() is not None:
            life.complain(f"`takt run` ended with {life.run.returncode}, left in peace")
        for name, (memory, files) in before.items():
            grown, more = after.get(name, (0, 0))[0] - memory, after.get(name, (0, 0))[1] - files
            print(f"{name} in peace, {2 * seconds / 3:.0f} s: {grown / 1024:+.0f} KiB resident, {more:+d} descriptors")
            if name not in after or grown > MOST_GROWTH or more > 0:
                life.complain(f"{name} grew by {grown} bytes and {more} descriptors")
        self.close_life(life)

    def go(self, minutes, rest_minutes):
        before = set(os.listdir("/dev/shm"))
        until = time.monotonic() + 60 * minutes
        while time.monotonic() < until:
            self.lives += 1
            life = Life(self, self.lives)
            life.live(90)
            self.close_life(life)
        self.in_peace(60 * rest_minutes)
        left = set(os.listdir("/dev/shm")) - before
        if left:
            self.wrong.append(f"left in /dev/shm: {sorted(left)}")
        if not self.wrong:
            shutil.rmtree(self.scratch, ignore_errors=True)
        for what, count in sorted(self.kinds.items()):
            print(f"{count:5d}  {what}")
        print(f"{self.lives} lives, {sum(self.kinds.values())} faults; folders replayed: "
              + ", ".join(f"{count} with {code}" for code, count in sorted(self.replayed.items())))
        print("\n".join(self.wrong) or "nothing was left behind, and no folder lacked a tick without saying so")
        return 1 if self.wrong else 0


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("programs", type=pathlib.Path)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--rest-minutes", type=float, help="of the life in peace; by default a tenth of --minutes, and a minute at least")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    wanted = parser.parse_args()
    print(f"seed {wanted.seed}", flush=True)
    return Soak(wanted.source.resolve(), wanted.programs.resolve(), wanted.seed).go(wanted.minutes, wanted.rest_minutes or max(1.0, 0.1 * wanted.minutes))


sys.exit(main())
