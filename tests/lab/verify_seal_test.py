#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a stranger finds every edit of a signed artifact or run folder with lab/artifact/verify_seal.py and the signer's key, and is told
where it is; OpenSSL reads what `takt seal` writes. Method: a small panel in virtual time and 35 recorded seconds of the virtual robot, both
signed; their signatures judged by the verifier, by `takt audit`, and by `openssl pkeyutl`, which knows nothing of either; then random flips,
cuts, swaps and insertions in their files, each of which the verifier must refuse by the name of the file and, where it grew with time, by the
ten seconds that hold its first altered byte. Its Ed25519 is held against the 151 vectors of ../shared/suites. Then an authority of the test's
own, `openssl ts`, stamps the signatures: the time is said, and what stamps something else, or is stamped by another, is refused.
Usage: verify_seal_test.py SOURCE_DIR BIN_DIR MAKE_RECORDED_DEMO [--count EDITS]     of the run folder; 300 unless said
10,000: python3 tests/lab/verify_seal_test.py . build/release/bin build/release/bin/make_recorded_demo --count 10000
Exit codes: 0 fine, 1 not, 77 the vectors are not there (1 with TAKT_REQUIRE_SHARED=1).
"""
import base64
import collections
import contextlib
import datetime
import io
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
EDITS = int(sys.argv[5]) if sys.argv[4:5] == ["--count"] else 300
ARTIFACT_EDITS = 200
RUN_SECONDS = 35
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
    """The kind of one edit that changes the bytes, and the bytes after it."""
    while True:
        at, kind, out = dice.randrange(len(data)), dice.choice(("flip", "cut", "swap", "insertion")), bytearray(data)
        size = dice.randrange(1, 64)
        if kind == "flip":
            out[at] ^= 1 << dice.randrange(8)
        elif kind == "cut":
            del out[at:at + size]
        elif kind == "swap":
            size = dice.randrange(1, 1 + min(64, len(data) // 2))
            at, other = sorted((dice.randrange(len(data) - size + 1), dice.randrange(len(data) - size + 1)))
            if other - at >= size:
                out[at:at + size], out[other:other + size] = data[other:other + size], data[at:at + size]
        else:
            out[at:at] = dice.randbytes(size)
        if out != data:
            return kind, bytes(out)


def refusal_of(folder, public):
    """What the verifier says; empty: it passes."""
    done = io.StringIO()
    with contextlib.redirect_stdout(done):
        code = verifier.main([str(folder), "--key", str(public)])
    return done.getvalue().removeprefix(f"{folder}: ").strip() if code == 1 else ""


def is_covered(name, after, before, segments):
    """Whether the signature covers what was edited. In the envelope white space means nothing, and the key's id is a hint; behind what
    events.jsonl held when the run was closed its writer may say more."""
    if name == "events.jsonl":
        return not after.startswith(before[:sum(one["bytes"] for one in segments[name])])
    if name != "seal.dsse.json":
        return True
    try:
        a, b = json.loads(after), json.loads(before)
        return (a["payloadType"], a["payload"], [one["sig"] for one in a["signatures"]]) != (b["payloadType"], b["payload"], [one["sig"] for one in b["signatures"]])
    except (ValueError, KeyError, TypeError):
        return True


def first_difference(a, b):
    """Of two byte strings that differ; where one goes on as the other, the length of the shorter."""
    begin, end = 0, min(len(a), len(b))
    if a[:end] == b[:end]:
        return end
    while end - begin > 1:
        middle = (begin + end) // 2
        begin, end = (middle, end) if a[begin:middle] == b[begin:middle] else (begin, middle)
    return begin


def place_of(name, after, before, segments):
    """How a refusal has to begin."""
    if name not in segments:
        return {"seal.json": "seal.json is not the file that was signed", "seal.dsse.json": ("seal.dsse.json", "what seal.dsse.json", "the payload of seal.dsse.json",
                "a signature of seal.dsse.json")}.get(name, f"{name} is not the file that was ")
    first, since, begin = first_difference(after, before), "its beginning", 0
    for one in segments[name]:
        until = datetime.datetime.fromtimestamp(one["until_unix_ns"] // 10**9, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
        if first < begin + one["bytes"]:
            return f"{name} is not as it was recorded from {since} to {until} (from byte {begin} on)"
        since, begin = until, begin + one["bytes"]
    return f"{name} has {len(after) - begin} bytes that were not recorded"


def check_edits(folder, public, count):
    dice, wrong, found, uncovered = random.Random(20261127), [], collections.Counter(), 0
    sealed = json.loads((folder / "seal.json").read_text())
    segments = sealed.get("segments", {})
    names = {*sealed["files"], *segments, "seal.json", "seal.dsse.json"}
    files = sorted(file for file in folder.rglob("*") if str(file.relative_to(folder)) in names or file.parent.name == "postmortems")
    while sum(found.values()) + len(wrong) < count:
        file = dice.choice(files)
        name, before = str(file.relative_to(folder)), file.read_bytes()
        kind, after = edited(before, dice)
        if not is_covered(name, after, before, segments):
            uncovered += 1
            continue
        file.write_bytes(after)
        refusal = refusal_of(folder, public)
        if refusal.startswith(place_of(name, after, before, segments)):
            found[kind] += 1
        else:
            wrong.append(f"{kind} in {name}: '{refusal}', and not '{place_of(name, after, before, segments)}'")
        file.write_bytes(before)
        if (done := sum(found.values()) + len(wrong)) % 500 == 0:
            print(f"{folder.name}: {sum(found.values())} of {done} edits found and located so far", flush=True)
    print(f"{folder.name}: {sum(found.values())} of {count} edits found and located ({', '.join(f'{kind} {count}' for kind, count in sorted(found.items()))}) in {len(files)} files "
          f"of {sum(map(len, segments.values()))} segments; {uncovered} more changed what the signature does not cover")
    if wrong or refusal_of(folder, public):
        raise SystemExit("\n".join(wrong[:10]) or "the honest folder does not pass")


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


AUTHORITY = """[tsa]
serial = {made}/serial
default_policy = 1.2.3.4.1
digests = sha256, sha512
signer_digest = sha256
ess_cert_id_alg = sha256
"""


def authority(made, name):
    """A root's certificate, and a function from a file and words for the query to the response's path."""
    root, signer, settings = made / f"{name}-root", made / f"{name}-signer", made / f"{name}.cnf"
    settings.write_text(AUTHORITY.format(made=made))
    (made / "purpose").write_text("extendedKeyUsage = critical, timeStamping\n")
    key = ("-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes")
    call("openssl", "req", "-x509", *key, "-keyout", f"{root}.key", "-out", f"{root}.pem", "-subj", f"/CN={name} root")
    call("openssl", "req", "-new", *key, "-keyout", f"{signer}.key", "-out", f"{signer}.csr", "-subj", f"/O=Takt/CN={name} clock")
    call("openssl", "x509", "-req", "-in", f"{signer}.csr", "-CA", f"{root}.pem", "-CAkey", f"{root}.key", "-CAcreateserial", "-extfile", made / "purpose",
         "-out", f"{signer}.pem")

    def stamp(file, *words):
        call("openssl", "ts", "-query", "-data", file, *(words or ("-sha256", "-cert")), "-out", made / "query")
        call("openssl", "ts", "-reply", "-config", settings, "-section", "tsa", "-queryfile", made / "query", "-inkey", f"{signer}.key", "-signer", f"{signer}.pem",
             "-out", made / "response.tsr")
        return made / "response.tsr"

    return f"{root}.pem", stamp


# Threat: signed-later
def check_time(made, folder, keys):
    """A signature's time: named with its authority, and believed from no other."""
    takt, public, (root, stamp), (another_root, _) = PROGRAMS / "takt", keys[0][1], authority(made, "trusted"), authority(made, "another")
    audit = (takt, "audit", folder, "--signed-by", public, "--time-by")
    code = 0 if "PASSED" in base64.b64decode(json.loads((folder / "seal.dsse.json").read_text())["payload"]).decode() else 1
    assert "cannot read" in call(*audit, root, expect=1), "there is no stamp yet"
    refused = "it stamps other bytes than seal.dsse.json"
    for file, words, sentence in ((folder / "seal.json", (), refused), (folder / "seal.dsse.json", ("-sha512", "-cert"), refused),
                                  (folder / "seal.dsse.json", ("-sha256",), "it holds no certificate of its signer")):
        assert sentence in call(takt, "seal", folder, "--time", stamp(file, *words), expect=1), sentence
    response = stamp(folder / "seal.dsse.json").read_bytes()
    call("openssl", "ts", "-reply", "-in", made / "response.tsr", "-token_out", "-out", made / "token")
    (made / "longer").write_bytes(response + b"0")
    for file in (made / "token", made / "longer", made / "query", public):
        assert "it is no granted response of RFC 3161" in call(takt, "seal", folder, "--time", file, expect=1), file
    assert not (folder / "seal.tsr").exists()

    said = call(takt, "seal", folder, "--time", made / "response.tsr")
    assert "by CN=trusted clock,O=Takt; takt audit --time-by checks who that is" in said, said
    said = call(*audit, root, expect=code)
    year = datetime.datetime.now(datetime.timezone.utc).year
    assert f", stamped {year}-" in said and "Z by CN=trusted clock,O=Takt\n" in said, said
    stamped = json.loads(call(*audit, root, "--json", expect=code))["stamped"]
    assert stamped["by"] == "CN=trusted clock,O=Takt" and stamped["utc"].startswith(f"{year}-"), stamped
    call("openssl", "ts", "-verify", "-in", folder / "seal.tsr", "-data", folder / "seal.dsse.json", "-CAfile", root)
    assert "; seal.tsr stamps it: by whom and when says openssl ts -verify" in call(VERIFIER, folder, "--key", public)

    assert "it is not stamped by that authority" in call(*audit, another_root, expect=1)
    assert "it holds no certificate in PEM form" in call(*audit, public, expect=1)
    turned = bytearray(response)
    turned[-9] ^= 1
    (folder / "seal.tsr").write_bytes(turned)
    assert "it is not stamped by that authority" in call(*audit, root, expect=1), "a byte of its signature"
    (folder / "seal.tsr").write_bytes(stamp(folder / "seal.json").read_bytes())
    assert refused in call(*audit, root, expect=1)
    assert "seal.tsr does not stamp seal.dsse.json" in call(VERIFIER, folder, "--key", public, expect=1)
    (folder / "seal.tsr").write_bytes(response)
    assert "seal.tsr stamped another signature" not in call(takt, "seal", folder, "--key", keys[0][0]), "the same signature"
    assert "seal.tsr stamped another signature and is removed" in call(takt, "seal", folder, "--key", keys[1][0])
    assert not (folder / "seal.tsr").exists()


def check_artifact(made, keys):
    panel, folder = made / "panel.yaml", made / "artifact"
    panel.write_text(PANEL.replace("SEEDS", "3").replace("config/arm6.yaml", str(SOURCE / "config/arm6.yaml")))
    call(PROGRAMS / "takt", "panel", "run", panel, "--out", folder, "--workers", "2")
    check_signatures(made, folder, keys, "WARNED")  # its post-mortems are not completed
    public = keys[0][1]
    for file in (folder / "postmortems").iterdir():
        copy = made / "copy"
        shutil.rmtree(copy, ignore_errors=True)
        shutil.copytree(folder, copy)
        (copy / "postmortems" / file.name).write_text("nothing happened\n")
        for words, code in (((VERIFIER, copy, "--key", public), 1), ((PROGRAMS / "takt", "audit", copy, "--signed-by", public), 1)):
            assert f"postmortems/{file.name} is not the file that was signed" in call(*words, expect=code)
    check_edits(folder, public, ARTIFACT_EDITS)
    call(VERIFIER, folder, "--key", public)
    check_time(made, folder, keys)


def check_run(made, keys, make_recorded_demo):
    folder = made / "run"
    call(make_recorded_demo, folder, RUN_SECONDS)
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
    check_edits(folder, public, EDITS)
    call(VERIFIER, folder, "--key", public)
    check_time(made, folder, keys)


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
