#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a robot whose file names a key is armed with the policy that the key's owner signed, and with no other. Method: the demo arm, its
policy signed by the commands of docs/policies.md; `takt config check`, the executive alone and `takt run` are asked with that
signature, with none, with another key's, with weights beside it that are signed and not, and with a policy that was changed afterwards;
the run's manifest has the hash of what the executive admitted.
Usage: signed_policy_test.py SOURCE_DIR BIN_DIR
"""
import hashlib
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

SOURCE, PROGRAMS = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
BAD_CONFIGURATION = 65


def call(*words):
    done = subprocess.run([str(word) for word in words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=60)
    return done.returncode, done.stdout


class Robot:
    def __init__(self, folder):
        self.folder, self.file, self.policy = folder, folder / "robot.yaml", folder / "policy.onnx"
        shutil.copy(SOURCE / "config/arm6_reach.onnx", self.policy)
        text = (SOURCE / "config/arm6.yaml").read_text()
        assert text.count("\npolicy:\n") == 1
        self.file.write_text(text.replace("\npolicy:\n", "\npolicy:\n  signed_by: lab.pub\n").replace("arm6_reach.onnx", "policy.onnx"))
        section = (SOURCE / "docs/policies.md").read_text().split("\n## Signed policies\n")[1].split("\n## ")[0]
        self.page = [line.strip() for line in section.splitlines() if line.startswith("    ")]
        assert len(self.page) == 4, self.page
        self.with_weights = [*self.page[:2], section.split("With weights the third line is `")[1].split("`")[0], self.page[3]]

    def sign(self, key, commands=None):
        for command in commands or self.page:
            done = subprocess.run(["sh", "-c", command.replace("lab.", f"{key}.")], cwd=self.folder, stderr=subprocess.PIPE, text=True, check=False)
            assert done.returncode == 0, (command, done.stderr)

    def run(self):
        return call(PROGRAMS / "takt", "run", self.file, "--arm", "--duration", "2s", "--allow-non-realtime", "--runtime-dir", self.folder / "sockets",
                    "--run-dir", self.folder / "run")

    def refused_by_all(self, sentence):
        """In one line each, before anything moves."""
        for words in (("takt", "config", "check", self.file), ("takt-executive", "--robot", self.file, "--runtime-dir", self.folder / "sockets", "--allow-non-realtime")):
            code, said = call(PROGRAMS / words[0], *words[1:])
            assert code == BAD_CONFIGURATION and sentence in said and len([line for line in said.splitlines() if "sign" in line]) == 1, (words, code, said)
        code, said = self.run()
        assert code == BAD_CONFIGURATION and sentence in said and not (self.folder / "run").exists(), (code, said)


def main():
    with tempfile.TemporaryDirectory(prefix="takt-signed.") as temporary:
        robot = Robot(pathlib.Path(temporary))
        robot.sign("lab")
        pathlib.Path(f"{robot.policy}.sig").unlink()
        robot.refused_by_all("policy.onnx: no signature: ")
        robot.sign("other")
        robot.refused_by_all("is not the file that the key of `policy.signed_by` signed")
        robot.sign("lab")
        code, said = call(PROGRAMS / "takt", "config", "check", robot.file)
        assert code == 0, said
        code, said = robot.run()
        assert code == 0 and (robot.folder / "run/ticks.mcap").exists(), (code, said)
        assert '"tracking"' in (robot.folder / "run/transitions.jsonl").read_text(), "armed, and driven by its policy"
        shutil.rmtree(robot.folder / "run")
        weights = robot.folder / "policy.onnx.data"
        weights.write_bytes(b"weights that no tensor names")
        robot.refused_by_all("is not the file that the key of `policy.signed_by` signed")
        robot.sign("lab", robot.with_weights)
        code, said = robot.run()
        assert code == 0, (code, said)
        listing = "".join(f"{hashlib.sha256(file.read_bytes()).hexdigest()}  {file.name}\n" for file in (robot.policy, weights))
        manifest = json.loads((robot.folder / "run/manifest.json").read_text())
        assert manifest["policy"]["sha256"] == hashlib.sha256(listing.encode()).hexdigest(), manifest["policy"]
        assert manifest["policy"]["sha256"].startswith(manifest["executive"]["facts"]["policy_hash"]), "the one that was admitted"
        shutil.rmtree(robot.folder / "run")
        with robot.policy.open("ab") as policy:
            policy.write(b"\0")
        robot.refused_by_all("is not the file that the key of `policy.signed_by` signed")
    print("armed with the signed policy, and with none of three others")
    return 0


if __name__ == "__main__":
    sys.exit(main())
