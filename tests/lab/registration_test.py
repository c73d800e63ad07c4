#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: what a panel is to show is fixed before it runs, and a later change shows. Method: a small panel is registered
(`takt seal PANEL`), stamped by an authority of the test's own, and run: the audit says so. Then each of its parts is changed before another
run, and each is named; a registration that is made, or put there, after the run began counts for nothing; one that is taken away is missed.
Usage: registration_test.py SOURCE_DIR BIN_DIR
"""
import hashlib
import json
import pathlib
import shutil
import sys
import tempfile

from evidence_forgeries_test import PANEL
from verify_seal_test import PROGRAMS, SOURCE, VERIFIER, authority, call, key_pair

TAKT = PROGRAMS / "takt"
EDITS = (  # of panel.yaml: what, by what, the sentence
    ("count: 2", "count: 3", "seeds: seeds 1 to 2, the same for every method registered, seeds 1 to 3, the same for every method ran"),
    ("bound: 20 mm", "bound: 30 mm", "rollouts of arm_tracking: 4 s, bound 0.02 m registered, 4 s, bound 0.03 m ran"),
    ("duration: 4 s", "duration: 5 s", "rollouts of arm_tracking: 4 s, bound 0.02 m registered, 5 s, bound 0.02 m ran"),
    ("value: 40 ms", "value: 60 ms", "method seldom on arm_tracking: another configuration ran"),
    ("name: seldom", "name: rarely", "method rarely ran, and was not registered"),
    ("kind: policy_crash", "kind: policy_freeze", "condition policy_crash at 2000 on arm_tracking was registered, and did not run"),
    ("how often it answers", "how quickly it answers", "claims: others than the registered ones"),
    ("every second observation", "one observation of two", "panel.yaml: another text than the registered one"),
    ("window: { from: 2 s", "window: { from: 1 s", "panel.yaml: another text than the registered one"),
)


class Panel:
    def __init__(self, made):
        self.made, self.file, self.runs = made, made / "panel.yaml", 0
        self.registration = made / "panel.registration.dsse.json"
        self.text = PANEL.replace("SEEDS", "2").replace("config/arm6.yaml", str(SOURCE / "config/arm6.yaml"))
        self.file.write_text(self.text)
        self.private, self.public = key_pair(made, "lab")

    def run(self, *words):
        self.runs += 1
        folder = self.made / f"run{self.runs}"
        call(TAKT, "panel", "run", self.file, "--out", folder, "--workers", "2", *words)
        return folder

    def audit(self, folder, *words, expect):
        return call(TAKT, "audit", folder, "--registered-by", self.public, *words, expect=expect)


def with_post_mortems(folder):
    for file in (folder / "postmortems").iterdir():
        file.write_text(file.read_text().replace("\ncompleted-by:", "The policy died, and the arm stopped.\n\ncompleted-by: A. Tester"))
    return folder


def check_registered(panel, root):
    folder = with_post_mortems(panel.run())
    key_id = hashlib.sha256(bytes.fromhex("302a300506032b6570032100") + raw_key(panel.public)).hexdigest()
    said = panel.audit(folder, "--time-by", root, expect=0)
    assert f"; registered by {key_id}\naudit-ready\n" in said and "Z by CN=trusted clock,O=Takt; the first row is not older than 20" in said, said
    assert "to decide: seldom against often, margin 5 %" in said, said
    assert "by the signer's clock; the first row is not older than" in panel.audit(folder, expect=0)
    facts = json.loads(panel.audit(folder, "--json", expect=0))
    assert facts["audit_ready"] and facts["registered"]["key"] == key_id and facts["registered"]["older"] and not facts["registered"]["differences"], facts
    assert "consistent: nothing is missing" in call(TAKT, "audit", folder), "an unchecked registration makes nothing ready"
    call(VERIFIER, folder)
    for file in ("registration.dsse.json", "registration.tsr"):
        copy = panel.made / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder, copy)
        (copy / file).unlink()
        assert file in call(VERIFIER, copy, expect=1) and file in call(TAKT, "audit", copy, expect=1), file
    return folder


def raw_key(public):
    sys.path.insert(0, str(VERIFIER.parent))
    import verify_seal  # noqa: E402
    return verify_seal.public_key(public)[0]


def check_edits(panel):
    for what, by, sentence in EDITS:
        assert what in panel.text, what
        panel.file.write_text(panel.text.replace(what, by))
        said = panel.audit(panel.run(), expect=1)
        assert f"differs: {sentence}\n" in said and "registered otherwise than it ran" in said and said.endswith("\nnot audit-ready\n"), f"{by}: {said}"
    panel.file.write_text(panel.text)
    for words, sentence in ((("--seeds", "1"), "seeds: seeds 1 to 2, the same for every method registered, seeds 1 to 1"),
                            (("--method", "often"), "method seldom was registered, and did not run"),
                            (("--until-decided", "often,seldom"), "end: every seed registered, until often,seldom is decided ran")):
        assert f"differs: {sentence}" in panel.audit(panel.run(*words), expect=1), words


def check_late(panel, stranger):
    """A registration of today for a panel of yesterday."""
    panel.registration.unlink()
    folder = with_post_mortems(panel.run())
    assert "registration        none\n" in call(TAKT, "audit", folder)
    assert "it keeps no registration" in panel.audit(folder, expect=1)
    call(TAKT, "seal", panel.file, "--key", panel.private)
    shutil.copy(panel.registration, folder / "registration.dsse.json")
    assert "registration.dsse.json is not in the seal" in call(VERIFIER, folder, expect=1)
    assert "registration.dsse.json is not the file that was sealed" in panel.audit(folder, expect=1)
    (folder / "seal.json").unlink()
    manifest = json.loads((folder / "manifest.json").read_text())
    manifest.update(complete=False, artifact_id="")
    (folder / "manifest.json").write_text(json.dumps(manifest))
    call(TAKT, "panel", "run", panel.file, "--out", folder, "--resume")
    said = panel.audit(folder, expect=1)
    assert "differs: the panel had begun\n" in said and "registered after the panel began" in said, said
    assert "registration.dsse.json is not signed by that key" in call(TAKT, "audit", folder, "--registered-by", stranger, expect=1)


def check_shards(panel):
    parts = [panel.run("--shard", f"{index}/2") for index in (1, 2)]
    whole = panel.made / "whole"
    call(TAKT, "panel", "merge", whole, *parts)
    assert "registered by" in panel.audit(whole, expect=1), "its post-mortems are not completed"
    assert "differs" not in panel.audit(whole, expect=1)
    call(TAKT, "seal", panel.file, "--key", panel.private)
    assert "the registration differs between" in call(TAKT, "panel", "merge", panel.made / "mixed", parts[0], panel.run("--shard", "2/2"), expect=1)
    assert not (panel.made / "mixed").exists(), "refused before anything is written"


def check_command_line(panel, folder):
    for words, code, sentence in (((panel.file, "--compare", "often,never", "--margin", "2%"), 64, "the panel has no method never"),
                                  ((panel.file, "--compare", "often,seldom", "--margin", "2"), 64, "--margin 2: write a share of success, such as 2%"),
                                  ((panel.file, "--compare", "often,seldom"), 64, "--margin"),
                                  ((folder, "--seeds", "3"), 64, "is no panel file, and these options are of one"),
                                  ((panel.public,), 65, "")):
        assert sentence in call(TAKT, "seal", *words, "--key", panel.private, expect=code), words
    assert "no private key" in call(TAKT, "seal", panel.file, "--key", panel.public, expect=1)
    assert "--time-by needs" in call(TAKT, "audit", folder, "--time-by", panel.public, expect=64)


# Threat: panel-chosen-later
def main():
    with tempfile.TemporaryDirectory(prefix="takt-registered.") as temporary:
        panel = Panel(pathlib.Path(temporary))
        root, stamp = authority(panel.made, "trusted")
        call(TAKT, "seal", panel.file, "--key", panel.private, "--compare", "often,seldom", "--margin", "5%")
        assert "stamps other bytes than panel.registration.dsse.json" in call(TAKT, "seal", panel.file, "--time", stamp(panel.file), expect=1)
        call(TAKT, "seal", panel.file, "--time", stamp(panel.registration))
        folder = check_registered(panel, root)
        check_command_line(panel, folder)
        check_edits(panel)
        check_shards(panel)
        check_late(panel, key_pair(panel.made, "stranger")[1])
    print(f"{len(EDITS) + 3} changes after a registration, each named")
    return 0


if __name__ == "__main__":
    sys.exit(main())
