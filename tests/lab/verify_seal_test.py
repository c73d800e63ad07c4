#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a stranger finds every edit of a signed artifact or run folder with lab/artifact/verify_seal.py and the signer's key, and
OpenSSL reads what `takt seal` writes. Method: a small panel in virtual time and a recorded run of the virtual robot, both signed; their
signatures judged by the verifier, by `takt audit`, and by `openssl pkeyutl`, which knows nothing of either; then random flips, cuts, swaps
and insertions in their files, each of which the verifier must refuse. Its Ed25519 is held against the 151 vectors of ../shared/suites.
Usage: verify_seal_test.py SOURCE_DIR BIN_DIR MAKE_RECORDED_DEMO [EDITS]     EDITS of each: 1000 unless said
Exit codes: 0 fine, 1 not, 77 the vectors are not there (1 with TAKT_REQUIRE_SHARED=1).
"""
import base64
import json
import os
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile

from evidence_forgeries_test import PANEL

SOURCE, PROGRAMS = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
EDITS = int(sys.argv[4]) if len(sys.argv) > 4 else 1000
VERIFIER = SOURCE / "lab/artifact/verify_seal.py"
sys.path.insert(0, str(VERIFIER.parent))
sys.dont_write_bytecode = True
import verify_seal as verifier  # noqa: E402


def call(*words, expect=0):
    done = subprocess.run([str(word) for word in words], cwd=SOURCE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=300)
    if done.returncode != expect:
        raise SystemExit(f"{words}: exit code {done.returncode}, not {expect}\n{done.stdout[-2000:]}")
    return done.stdout


def key_pair(made, name):
    private, public = made / f"{name}.pem", made / f"{name}.pub"
    call("openssl", "genpkey", "-algorithm", "ed25519", "-out", private)
    call("openssl", "pkey", "-in", private, "-pubout", "-out", public)
    return private, public


def check_vectors():
    file = SOURCE.parent / "shared/suites/ed25519/ed25519_test.json"
    if not file.exists():
        print(f"SKIPPED: {file} is not there: the verifier's Ed25519 was not held against published vectors")
        return False
    groups = json.loads(file.read_text())["testGroups"]
    cases = [(bytes.fromhex(group["publicKey"]["pk"]), case) for group in groups for case in group["tests"]]
    wrong = [case["tcId"] for key, case in cases
             if verifier.is_signature(key, bytes.fromhex(case["msg"]), bytes.fromhex(case["sig"])) != (case["result"] == "valid")]
    if wrong or len(cases) != 151:
        raise SystemExit(f"{len(wrong)} of {len(cases)} vectors came out otherwise: {wrong[:10]}")
    print("151 of 151 published vectors")
    return True


def check_by_openssl(made, folder, public):
    """A peer's judgement: DSSE's encoding and the signature, read by OpenSSL's own program."""
    envelope = json.loads((folder / "seal.dsse.json").read_text())
    payload = base64.b64decode(envelope["payload"])
    kind = envelope["payloadType"].encode()
    (made / "message").write_bytes(b"DSSEv1 %d %s %d %s" % (len(kind), kind, len(payload), payload))
    (made / "signature").write_bytes(base64.b64decode(envelope["signatures"][0]["sig"]))
    said = call("openssl", "pkeyutl", "-verify", "-pubin", "-inkey", public, "-rawin", "-in", made / "message", "-sigfile", made / "signature")
    assert "Verified Successfully" in said, said
    statement = json.loads(payload)
    assert [one["name"] for one in statement["subject"]][0] == "seal.json"
    return statement["predicate"]["result"]


def edited(data, dice):
    """The bytes after one edit that changes them."""
    while True:
        at, kind, out = dice.randrange(len(data)), dice.randrange(4), bytearray(data)
        if kind == 0:
            out[at] ^= 1 << dice.randrange(8)
        elif kind == 1:
            del out[at:at + dice.randrange(1, 64)]
        elif kind == 2:
            other = dice.randrange(len(data))
            out[at], out[other] = out[other], out[at]
        else:
            out[at:at] = dice.randbytes(dice.randrange(1, 16))
        if out != data:
            return bytes(out)


def is_found(folder, public):
    try:
        if (folder / "rollouts.jsonl").exists():
            verifier.check_seal(folder)
            verifier.check_rows(folder)
        else:
            verifier.check_run(folder)
        verifier.check_signature(folder, public)
    except verifier.Refused:
        return True
    return False


def same_json(name, data, before):
    """White space of the envelope means nothing, and neither does what it says about the key: both are outside the signature."""
    if name != "seal.dsse.json":
        return False
    try:
        a, b = json.loads(data), json.loads(before)
        return (a["payloadType"], a["payload"], [one["sig"] for one in a["signatures"]]) == (b["payloadType"], b["payload"], [one["sig"] for one in b["signatures"]])
    except (ValueError, KeyError, TypeError):
        return False


def check_edits(folder, public):
    dice, passed, harmless = random.Random(20261127), [], 0
    sealed = json.loads((folder / "seal.json").read_text())
    names = {*sealed["files"], *sealed.get("segments", ()), "seal.json", "seal.dsse.json"}
    files = sorted(file for file in folder.rglob("*") if str(file.relative_to(folder)) in names or file.parent.name == "postmortems")
    for number in range(EDITS):
        file = dice.choice(files)
        before = file.read_bytes()
        after = edited(before, dice)
        if same_json(file.name, after, before):
            harmless += 1
            continue
        file.write_bytes(after)
        if not is_found(folder, public):
            passed.append(f"edit {number} of {file.relative_to(folder)}")
        file.write_bytes(before)
    print(f"{folder.name}: {EDITS} edits: {EDITS - harmless - len(passed)} found, {harmless} changed only what the signature does not cover, {len(passed)} passed {passed[:5]}")
    if passed:
        raise SystemExit("edits pass")


def check_signatures(made, folder, keys, result):
    """Before and after `takt seal`: what the verifier, the audit and OpenSSL say with the right key, another, and none."""
    takt, (private, public), (_, stranger) = PROGRAMS / "takt", *keys
    assert "no signature was checked" in call(VERIFIER, folder)
    assert "seal.dsse.json is not there" in call(VERIFIER, folder, "--key", public, expect=1)
    call(takt, "seal", folder, "--key", private)
    key_id = verifier.public_key(public)[1]
    assert f"signed by {key_id}" in call(VERIFIER, folder, "--key", public)
    assert f"signed by {key_id}" in call(takt, "audit", folder, "--signed-by", public, expect=0 if result == "PASSED" else 1)
    assert "not signed by that key" in call(VERIFIER, folder, "--key", stranger, expect=1)
    assert "not signed by that key" in call(takt, "audit", folder, "--signed-by", stranger, expect=1)
    assert "no public key" in call(takt, "audit", folder, "--signed-by", private, expect=1)
    assert "no private key" in call(takt, "seal", folder, "--key", public, expect=1)
    said = check_by_openssl(made, folder, public)
    assert said == result, said


def check_artifact(made, keys):
    panel, folder = made / "panel.yaml", made / "artifact"
    panel.write_text(PANEL.replace("SEEDS", "3").replace("config/arm6.yaml", str(SOURCE / "config/arm6.yaml")))
    call(PROGRAMS / "takt", "panel", "run", panel, "--out", folder, "--workers", "2")
    check_signatures(made, folder, keys, "WARNED")  # nobody completed its post-mortems
    public = keys[0][1]
    for file in (folder / "postmortems").iterdir():
        copy = made / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder, copy)
        (copy / "postmortems" / file.name).write_text("nothing happened\n")
        for words, code in (((VERIFIER, copy, "--key", public), 1), ((PROGRAMS / "takt", "audit", copy, "--signed-by", public), 1)):
            assert f"postmortems/{file.name} is not the file that was signed" in call(*words, expect=code)
    check_edits(folder, public)
    call(VERIFIER, folder, "--key", public)


def check_run(made, keys, make_recorded_demo):
    call(make_recorded_demo, made / "demo")
    folder = next(path.parent for path in [made / "demo", *(made / "demo").iterdir()] for path in [path / "seal.json"] if path.exists())
    takt, public = PROGRAMS / "takt", keys[0][1]
    assert "consistent: --signed-by makes it audit-ready" in call(takt, "audit", folder)
    check_signatures(made, folder, keys, "PASSED")
    assert call(takt, "audit", folder, "--signed-by", public).endswith("\naudit-ready\n")
    frames = (folder / "can.log.zst").read_bytes()
    (folder / "can.log.zst").write_bytes(frames[:99] + bytes([frames[99] ^ 1]) + frames[100:])
    assert "can.log.zst is not as it was recorded from its beginning to 20" in call(VERIFIER, folder, "--key", public, expect=1)
    assert "can.log.zst is not as it was recorded from its beginning to 20" in call(takt, "audit", folder, expect=1)
    assert "can.log.zst is not as it was recorded" in call(takt, "seal", folder, "--key", keys[0][0], expect=1), "an edited run is not sealed again"
    (folder / "can.log.zst").write_bytes(frames)
    check_edits(folder, public)
    call(VERIFIER, folder, "--key", public)


# Threat: run-edited
def main():
    with tempfile.TemporaryDirectory(prefix="takt-verify.") as temporary:
        made = pathlib.Path(temporary)
        keys = key_pair(made, "lab"), key_pair(made, "stranger")
        check_artifact(made, keys)
        check_run(made, keys, pathlib.Path(sys.argv[3]))
    if check_vectors():
        return 0
    return 1 if os.environ.get("TAKT_REQUIRE_SHARED") == "1" else 77


if __name__ == "__main__":
    sys.exit(main())
