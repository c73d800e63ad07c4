# SPDX-License-Identifier: Apache-2.0
"""Runs the test programs of the rewritten tree, with one mutant awake at a time, and says who noticed."""
import dataclasses
import hashlib
import json
import os
import pathlib
import re
import resource
import signal
import subprocess
import tempfile
import threading
import time

EXPLORED_SCHEDULES = 15
CASES_OF_A_PROPERTY = 30  # of rapidcheck
LARGEST_OUTPUT = 32 << 20  # bytes
LARGEST_MEMORY = 4 << 30
LONGEST_SLEEP_S = 60  # with no thread that could run; who only waits for a busy machine is waited for
ORACLE = re.compile(r"^([a-z_]+): \S+ at [0-9.]+ s, ", re.M)
FAILED = re.compile(r"^\[  FAILED  \] ([\w/]+\.[\w/]+)", re.M)
STARTED = re.compile(r"^\[ RUN      \] ([\w/]+\.[\w/]+)", re.M)


@dataclasses.dataclass
class Outcome:
    killed: bool
    tests: list    # that failed, or during which it ended
    oracles: list  # of the exploration
    how: str = ""  # "crash", "time", "memory or output"; empty: tests failed


def outcome_of(code, output):
    """What a program's exit code and output say."""
    tests, oracles = sorted(set(FAILED.findall(output))), sorted(set(ORACLE.findall(output)))
    if code == 0:
        return Outcome(False, [], [])
    if code > 0:
        return Outcome(True, tests, oracles)
    started = STARTED.findall(output)
    how = {-9: "time", -24: "time", -25: "output"}.get(code, "crash")
    return Outcome(True, tests or started[-1:], oracles, how)


def can_run(pid):
    """Whether a thread of the process runs, or waits for a processor or a disk; a process that is gone does not."""
    try:
        return any(pathlib.Path(task, "stat").read_text().rpartition(")")[2].split()[0] in "RD" for task in pathlib.Path(f"/proc/{pid}/task").iterdir())
    except OSError:
        return False


def end_who_sleeps(child, ended, longest_s=LONGEST_SLEEP_S):
    """A mutant may wait for ever for what never comes."""
    slept_s, step_s = 0.0, longest_s / 240
    while not ended.wait(step_s):
        slept_s = 0.0 if can_run(child.pid) else slept_s + step_s
        if slept_s >= longest_s:
            os.kill(child.pid, signal.SIGKILL)  # not reaped yet: the number is still its
            return


class Program:
    def __init__(self, build, name, arguments, top):
        self.name, self.top = name, top
        self.command = [str(build / "bin" / name), *arguments, "--gtest_color=no"]
        self.digest = hashlib.sha256(pathlib.Path(self.command[0]).read_bytes() + repr(self.command[1:]).encode()).hexdigest()[:12]
        self.cpu_s, self.wall_s = 100.0, 0.0  # that the original takes; measured by look_at_original
        self.reaches = set()

    def run(self, mutant=None, record=None):
        """(Outcome, processor seconds)."""
        environment = {**os.environ, "TAKT_SEEDS": str(EXPLORED_SCHEDULES), "TAKT_SHORTEN": "0", 
                       "RC_PARAMS": f"seed=1 max_success={CASES_OF_A_PROPERTY}"}
        for name, value in (("TAKT_MUTANT", mutant), ("TAKT_MUTANTS_REACHED", record)):
            environment.pop(name, None)
            if value:
                environment[name] = str(value)
        cpu = int(4 * self.cpu_s + 4)

        def bounded():
            resource.setrlimit(resource.RLIMIT_CPU, (cpu, cpu))
            resource.setrlimit(resource.RLIMIT_FSIZE, (LARGEST_OUTPUT, LARGEST_OUTPUT))
            resource.setrlimit(resource.RLIMIT_AS, (LARGEST_MEMORY, LARGEST_MEMORY))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

        with tempfile.TemporaryDirectory(prefix="takt-mutant.") as folder, open(os.path.join(folder, "output"), "w+b") as output:
            environment.update(XDG_RUNTIME_DIR=folder, TMPDIR=folder)
            child = subprocess.Popen(self.command, cwd=self.top, env=environment, stdin=subprocess.DEVNULL, stdout=output,
                                     stderr=subprocess.STDOUT, preexec_fn=bounded)
            ended = threading.Event()
            watcher = threading.Thread(target=end_who_sleeps, args=(child, ended))
            watcher.start()
            os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
            ended.set()
            watcher.join()
            _, status, usage = os.wait4(child.pid, 0)
            child.returncode = os.waitstatus_to_exitcode(status)
            output.seek(0)
            return outcome_of(child.returncode, output.read(4 << 20).decode(errors="replace")), usage.ru_utime + usage.ru_stime

    def look_at_original(self):
        """Says what the original reaches, and what it costs. It must pass."""
        with tempfile.NamedTemporaryFile(prefix="takt-mutant.") as record:
            outcome, _ = self.run(record=record.name)
            if outcome.killed:
                raise ValueError(f"{self.name} fails without a mutant: {outcome}")
            # Saying what is reached costs several times the tests themselves: a mutant is given what they cost without it.
            began = time.monotonic()
            _, self.cpu_s = self.run()
            self.wall_s = time.monotonic() - began
            self.reaches = set(pathlib.Path(record.name).read_text().split())


class Memory:
    """Outcomes of earlier runs, while the programs are the same."""

    def __init__(self, path):
        self.path, self.lock, self.kept = path, threading.Lock(), {}
        if path.exists():
            for line in path.read_text().splitlines():
                one = json.loads(line)
                self.kept[one["mutant"], one["program"], one["digest"]] = Outcome(**one["outcome"])

    def outcome(self, mutant, program):
        found = self.kept.get((mutant, program.name, program.digest))
        if found is None:
            found, _ = program.run(mutant)
            with self.lock:
                self.kept[mutant, program.name, program.digest] = found
                with open(self.path, "a") as file:
                    file.write(json.dumps({"mutant": mutant, "program": program.name, "digest": program.digest,
                                           "outcome": dataclasses.asdict(found)}) + "\n")
        return found
