# SPDX-License-Identifier: Apache-2.0
"""A robot under `takt run`, and a person at it by `takt`."""
import json
import subprocess
import time


class Operated:
    """`programs`: folder of Takt's programs; `sockets`: the runtime directory."""

    def __init__(self, programs, sockets):
        self.programs, self.sockets = programs, sockets

    def takt(self, *words):
        return subprocess.run([self.programs / "takt", *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60)

    def ask(self, verb):
        return self.takt(verb, "--runtime-dir", self.sockets)

    def start(self, robot, run_folder, *more, duration="7200s", **how):
        words = ["run", robot, "--arm", "--allow-non-realtime", "--duration", duration, "--runtime-dir", self.sockets, "--run-dir", run_folder, *more]
        return subprocess.Popen([self.programs / "takt", *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, **how)

    def status(self):
        """{}: no executive answers."""
        said = json.loads(self.takt("status", "--runtime-dir", self.sockets, "--json").stdout)
        return said["status"] or {}

    def wait_until(self, holds, seconds=20):
        """Whether it came to hold of the status."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            if holds(self.status()):
                return True
        return False

    def get_going(self):
        """Whether it tracks, out of a stop if need be."""
        def asked(status):
            verb = {"damped_stop": "reset", "fault_latched": "reset", "standby": "arm"}.get(status.get("mode"))
            if verb:
                self.ask(verb)
            return status.get("mode") == "tracking"
        return self.wait_until(asked, 60)
