#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: one command stops every robot of a machine, and is no second press of one that stops already. Method: three simulated robots run in a /run
of their own, one of them with another runtime directory; `takt stop` alone names the way; one is stopped, then all, twice, then all with --now: what
each robot's own status says, which file it runs too.
Usage: stop_all_test.py SOURCE_DIR BIN_DIR. Exit codes: 0 fine, 1 not, 77 no mount namespace may be made here (1 with TAKT_REQUIRE_NAMESPACES=1)."""
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parent)]
from patient import patient  # noqa: E402

INSIDE = "--inside"


ROBOTS = {"left": (), "right": (), "far": ("--runtime-dir", "sockets")}  # where each one's sockets are


def ask(programs, *words):
    return subprocess.run([programs / "takt", *words], capture_output=True, text=True, timeout=60)


class Robots:
    """Of the demo arm; one after the other, so that a later one says that they share a core."""

    def __init__(self, source, programs, folder):
        self.programs, self.folder, self.runs = programs, folder, {}
        shutil.copytree(source / "config", folder / "config")
        for name in ROBOTS:
            text = patient((folder / "config/arm6.yaml").read_text()).replace("robot: arm6", f"robot: {name}")
            for bus in ("can0", "can1"):
                text = text.replace(f"interface: {bus}", f"interface: {name}{bus}")
            # The last one's core is none that this machine has.
            self.file(name).write_text(text.replace("  cpu: 1 ", "  cpu: 1023 ") if name == "far" else text)

    def file(self, name):
        return self.folder / f"config/{name}.yaml"

    def log(self, name):
        return (self.folder / f"{name}.log").read_text()

    def start(self, name):
        words = ["takt", "run", self.file(name), "--arm", "--run-dir", self.folder / f"run-{name}", "--allow-non-realtime", "--duration", "100s", "--to-the-end"]
        self.runs[name] = subprocess.Popen([self.programs / words[0], *words[1:], *ROBOTS[name]], cwd=self.folder,
                                           stdout=(self.folder / f"{name}.log").open("w"), stderr=subprocess.STDOUT)
        self.wait_for(name, "tracking")

    def end(self):
        for run in self.runs.values():
            run.terminate()
            run.wait(timeout=60)

    def mode(self, name):
        where = ("--runtime-dir", self.folder / "sockets") if ROBOTS[name] else ("--robot", self.file(name))
        said = ask(self.programs, "status", "--json", *where).stdout
        return json.loads(said)["status"]["mode"] if said and json.loads(said)["status"] else None

    def wait_for(self, name, mode):
        deadline = time.monotonic() + 60
        while self.mode(name) != mode:
            assert time.monotonic() < deadline, f"{name}: {self.mode(name)}, not {mode}: {self.log(name)}"
            time.sleep(0.05)


def stops(programs, robots):
    """Every stop reaches whom it names, and no other."""
    robots.start("far")
    unseen = ask(programs, "stop")
    assert unseen.returncode == 69 and f"elsewhere far: --runtime-dir {robots.folder / 'sockets'}" in unseen.stderr, unseen
    assert "control.cpu 1023: this machine has cores 0 to " in robots.log("far"), robots.log("far")
    robots.start("left")
    one = ask(programs, "stop")
    assert one.returncode == 0 and f"note: far runs on: takt stop --runtime-dir {robots.folder / 'sockets'}, or takt stop --all" in one.stderr, one
    assert robots.mode("far") == "tracking"
    ask(programs, "stop", "--robot", robots.file("left"), "--now")
    robots.wait_for("left", "standby")
    assert ask(programs, "arm", "--robot", robots.file("left")).returncode == 0
    robots.wait_for("left", "tracking")
    robots.start("right")
    shared = "control.cpu 1 is robot left's too"
    assert shared in robots.log("right") and shared not in robots.log("left")
    told = ask(programs, "status", "--robot", robots.file("left")).stdout
    assert f"robot      left, {robots.file('left').resolve()}; hashes: file " in told, told
    assert ask(programs, "status", "--robot", "left").stdout.splitlines()[-1] == told.splitlines()[-1], "a robot's name is enough"
    assert ask(programs, "status", "--robot", "lift").returncode == 65
    asked = ask(programs, "stop")
    assert asked.returncode == 64 and "takt stop --all" in asked.stderr, asked
    left = ask(programs, "stop", "--robot", robots.file("left"))
    assert left.returncode == 0 and "until `takt reset`" in left.stdout, left
    robots.wait_for("left", "damped_stop")
    assert robots.mode("right") == robots.mode("far") == "tracking"
    for _ in range(2):
        stopped = ask(programs, "stop", "--all")
        assert stopped.returncode == 0 and "left: mode damped_stop" in stopped.stdout, stopped
        assert "second stop" not in stopped.stdout, stopped  # it is no press
        robots.wait_for("right", "damped_stop")
        robots.wait_for("far", "damped_stop")
        assert robots.mode("left") == "damped_stop"
        time.sleep(0.3)  # a second press counts 0.2 s after the first: nothing is waited for
    said = json.loads(ask(programs, "stop", "--all", "--now", "--json").stdout)["robots"]
    assert [(each["robot"], each["done"]) for each in said] == [("left", True), ("right", True), ("far", True)], said
    for name in ROBOTS:
        robots.wait_for(name, "standby")
    again = ask(programs, "stop", "--robot", robots.file("left"))
    assert again.returncode == 0 and "the next `takt arm` moves the robot" in again.stdout, again
    refused = ask(programs, "stop", "--all", "--robot", robots.file("left"))
    assert refused.returncode == 64, refused


def inside(source, programs):
    with tempfile.TemporaryDirectory(prefix="takt-all.") as made:
        robots = Robots(source, programs, pathlib.Path(made).resolve())
        try:
            stops(programs, robots)
        finally:
            robots.end()
        assert ask(programs, "stop", "--all").returncode == 69
    return 0


def main():
    source, programs = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    if INSIDE in sys.argv:
        return inside(source, programs)
    own = ["--mount", "--pid", "--fork", "--mount-proc"]  # no other robot of this machine
    for words in (["unshare", *own], ["unshare", "--map-root-user", *own]):
        if subprocess.run([*words, "mount", "-t", "tmpfs", "tmpfs", "/run"], capture_output=True).returncode == 0:
            again = 'mount -t tmpfs tmpfs /run && exec "$@"'
            return subprocess.run([*words, "sh", "-c", again, "again", sys.executable, __file__, source, programs, INSIDE]).returncode
    print("NOT TESTED: NO MOUNT NAMESPACE MAY BE MADE HERE: `takt stop --all`")
    return 1 if os.environ.get("TAKT_REQUIRE_NAMESPACES") == "1" else 77


if __name__ == "__main__":
    sys.exit(main())
