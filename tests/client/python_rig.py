# SPDX-License-Identifier: Apache-2.0
"""A Python policy beside real processes: the wheel in a fresh environment, a folder with robot.yaml (the demo arm, patient) and policy.py, and `takt run`.
Tests that use it are called with SOURCE_DIR BUILD_DIR.
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
SOURCE, BUILD = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
sys.dont_write_bytecode = True
sys.path[:0] = [str(HERE), str(HERE.parent / "process"), str(SOURCE / "client/python")]
from patient import patient  # noqa: E402


class PythonRig(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.python_home = tempfile.mkdtemp(prefix="takt-venv.")
        cls.venv = pathlib.Path(cls.python_home) / "venv"
        # Debian's numpy is the one thing it sees of the system.
        subprocess.run(["/usr/bin/python3", "-m", "venv", "--system-site-packages", cls.venv], check=True)
        subprocess.run([cls.venv / "bin/pip", "install", "--quiet", "--disable-pip-version-check", "--no-index", "--no-deps", "--find-links",
                        BUILD / "python", "takt"], check=True)

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.python_home)

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="takt-python."))
        self.addCleanup(shutil.rmtree, self.folder)
        self.environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "LD_"))}
        self.environment.update(XDG_RUNTIME_DIR=str(self.folder), PATH=f"{self.venv}/bin:{BUILD}/bin:/usr/bin:/bin")
        self.robot(lambda text: text)

    def robot(self, change):
        """robot.yaml: the demo arm under policy.py, patient with a machine that stalls."""
        text = (SOURCE / "config/arm6.yaml").read_text()
        self.assertIn("file: arm6_reach.onnx", text)
        text = patient(text).replace("file: arm6_reach.onnx", "file: policy.py")
        (self.folder / "robot.yaml").write_text(change(text))

    def replace(self, *pairs):
        """In robot.yaml, each of what stands there once."""
        path = self.folder / "robot.yaml"
        text = path.read_text()
        for old, new in pairs:
            self.assertEqual(text.count(old), 1, old)
            text = text.replace(old, new)
        path.write_text(text)

    def policy(self, text):
        path = self.folder / "policy.py"
        path.write_text(f"#!{self.venv}/bin/python\n" + text)
        path.chmod(0o755)

    def command(self, *arguments):
        return subprocess.run(arguments, cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=120, check=False)

    def run_robot(self, duration, may="write=."):
        done = self.command("takt", "run", "robot.yaml", "--policy-host", "./policy.py", "--arm", "--duration", duration, "--run-dir", "run",
                            "--policy-may", may, "--plant=--truth=truth.jsonl")
        log = self.folder / "run/logs/takt-policy-host.log"
        return done, log.read_text() if log.exists() else ""
