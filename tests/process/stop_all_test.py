#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: one command stops every robot of a machine, and is no second press of one that stops already. Method: two simulated robots run in a /run of
their own; `takt stop` alone names the way; one is stopped, then all, twice, then all with --now: what each robot's own status says,
which file it runs too.
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


def ask(programs, *words):
    return subprocess.run([programs / "takt", *words], capture_output=True, text=True, timeout=60)


def mode(programs, robot):
    said = ask(programs, "status", "--json", "--robot", robot).stdout
    return json.loads(said)["status"]["mode"] if said and json.loads(said)["status"] else None


def wait_for(programs, robot, wanted):
    deadline = time.monotonic() + 60
    while mode(programs, robot) != wanted:
        assert time.monotonic() < deadline, f"{robot}: {mode(programs, robot)}, not {wanted}"
        time.sleep(0.05)


def two_robots(source, programs, folder):
    shutil.copytree(source / "config", folder / "config")
    files, runs = [], []
    for name in ("left", "right"):  # one after the other: the second says that they share a core
        text = patient((folder / "config/arm6.yaml").read_text()).replace("robot: arm6", f"robot: {name}")
        for bus in ("can0", "can1"):
            text = text.replace(f"interface: {bus}", f"interface: {name}{bus}")
        files.append(folder / f"config/{name}.yaml")
        files[-1].write_text(text)
        runs.append(subprocess.Popen([programs / "takt", "run", files[-1], "--arm", "--run-dir", folder / f"run-{name}", "--allow-non-realtime",
                                      "--duration", "100s", "--to-the-end"], stdout=(folder / f"{name}.log").open("w"), stderr=subprocess.STDOUT))
        wait_for(programs, files[-1], "tracking")
    return files, runs


def inside(source, programs):
    with tempfile.TemporaryDirectory(prefix="takt-all.") as made:
        folder = pathlib.Path(made)
        (left, right), runs = two_robots(source, programs, folder)
        try:
            shared = "control.cpu 1 is robot left's too"
            assert shared in (folder / "right.log").read_text() and shared not in (folder / "left.log").read_text()
            told = ask(programs, "status", "--robot", left).stdout
            assert f"robot      left, {left.resolve()}; hashes: file " in told, told
            asked = ask(programs, "stop")
            assert asked.returncode == 64 and "takt stop --all" in asked.stderr, asked
            assert ask(programs, "stop", "--robot", left).returncode == 0
            wait_for(programs, left, "damped_stop")
            assert mode(programs, right) == "tracking"
            for _ in range(2):
                stopped = ask(programs, "stop", "--all")
                assert stopped.returncode == 0 and "left: mode damped_stop, not pressed again" in stopped.stdout, stopped
                wait_for(programs, right, "damped_stop")
                assert mode(programs, left) == "damped_stop"
                time.sleep(0.3)  # a second press counts 0.2 s after the first: nothing is waited for
            said = json.loads(ask(programs, "stop", "--all", "--now", "--json").stdout)["robots"]
            assert [(each["robot"], each["done"]) for each in said] == [("left", True), ("right", True)], said
            for file in (left, right):
                wait_for(programs, file, "standby")
            refused = ask(programs, "stop", "--all", "--robot", left)
            assert refused.returncode == 64, refused
        except AssertionError:
            for name in ("left", "right"):
                print((folder / f"{name}.log").read_text())
            raise
        finally:
            for run in runs:
                run.terminate()
                run.wait(timeout=60)
        assert ask(programs, "stop", "--all").returncode == 69
    return 0


def main():
    source, programs = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    if INSIDE in sys.argv:
        return inside(source, programs)
    for words in (["unshare", "--mount"], ["unshare", "--map-root-user", "--mount"]):
        if subprocess.run([*words, "mount", "-t", "tmpfs", "tmpfs", "/run"], capture_output=True).returncode == 0:
            again = 'mount -t tmpfs tmpfs /run && exec "$@"'
            return subprocess.run([*words, "sh", "-c", again, "again", sys.executable, __file__, source, programs, INSIDE]).returncode
    print("NOT TESTED: NO MOUNT NAMESPACE MAY BE MADE HERE: `takt stop --all`")
    return 1 if os.environ.get("TAKT_REQUIRE_NAMESPACES") == "1" else 77


if __name__ == "__main__":
    sys.exit(main())
