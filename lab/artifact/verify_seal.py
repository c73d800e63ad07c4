#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Says whether an artifact of `takt panel`, or a run folder, is the one that was sealed, and signed, without any code of Takt's.

Usage: verify_seal.py DIR [--key PUBLIC.pem]
Exit codes: 0 it is; 1 it is not, with the reason; 64 command line.

Of an artifact it reads seal.json (SHA-256 of every file) and rollouts.sha256 (a chain: each row's line is SHA-256 over the line before,
a line end, and the row with its line end); of a run folder seal.json (SHA-256 of each whole file, and of each 10 s of those that grew);
with --key seal.dsse.json: a DSSE envelope (version 1) around an in-toto Statement v1, signed by Ed25519. The signature is judged by
RFC 8032, section 5.1.7, strictly: one encoding of each number, no cofactor. Of a time stamp of it, seal.tsr, only what it stamps is read:
openssl ts -verify -in DIR/seal.tsr -data DIR/seal.dsse.json -CAfile AUTHORITY.pem   judges the rest.
Without --key the files are compared with each other only: an edit of all of them passes. Python's standard library, 3.9 or later.
"""
import base64
import datetime
import hashlib
import json
import pathlib
import re
import sys

SEALED = ("manifest.json", "panel.yaml", "rollout.schema.json", "rollouts.jsonl", "rollouts.sha256", "rollouts.parquet", "confusion.json")
SEAL, ENVELOPE, STAMP = "seal.json", "seal.dsse.json", "seal.tsr"
INPUTS = "inputs.json"
OPTIONAL = {INPUTS, "registration.dsse.json", "registration.tsr"}  # an earlier version keeps no inputs
PAYLOAD_TYPE = "application/vnd.in-toto+json"
STATEMENT_TYPES = ("https://in-toto.io/Statement/v1", "https://in-toto.io/attestation/test-result/v0.1")  # its own, its predicate's
IMPRINTS = ("300d060960864801650304020105000420", "300b06096086480165030402010420")  # SHA-256 in DER, with its empty parameter and without
MOST_BYTES = 4 << 30
EVENTS = "events.jsonl"  # its writer goes on when the run is closed; absent where nothing wrote it
GROWN = ("ticks.mcap", "can.log.zst", "transitions.jsonl", EVENTS)  # "can.log" of earlier versions: the same lines, plain
WHOLE = ("manifest.json", "config.yaml", "drives.json")

P = 2**255 - 19  # the curve of RFC 8032, section 5.1
L = 2**252 + 27742317777372353535851937790883648493
D = -121665 * pow(121666, P - 2, P) % P
ROOT = pow(2, (P - 1) // 4, P)


class Refused(Exception):
    """Why the artifact is not sound: one sentence."""


def point_of(data):
    """The point that 32 bytes encode, as (X, Y, Z, T); None: they encode none, or not in the one way."""
    y = int.from_bytes(data, "little")
    sign, y = y >> 255, y & (2**255 - 1)
    if y >= P:
        return None
    square = (y * y - 1) * pow(D * y * y + 1, P - 2, P) % P
    x = pow(square, (P + 3) // 8, P)
    x = x * ROOT % P if (x * x - square) % P else x
    if (x * x - square) % P or (x == 0 and sign):
        return None
    x = P - x if x & 1 != sign else x
    return x, y, 1, x * y % P


def add(a, b):
    e = (a[1] - a[0]) * (b[1] - b[0]) % P
    f = (a[1] + a[0]) * (b[1] + b[0]) % P
    g = 2 * a[3] * b[3] * D % P
    h = 2 * a[2] * b[2] % P
    return (f - e) * (h - g) % P, (h + g) * (f + e) % P, (h - g) * (h + g) % P, (f - e) * (f + e) % P


def times(number, point):
    total = (0, 1, 1, 0)
    while number:
        if number & 1:
            total = add(total, point)
        point = add(point, point)
        number >>= 1
    return total


BASE = point_of((4 * pow(5, P - 2, P) % P).to_bytes(32, "little"))


def is_signature(public, message, signature):
    """Whether the 64 bytes are the Ed25519 signature of the message by the key of 32 bytes."""
    if len(signature) != 64 or len(public) != 32:
        return False
    key, s = point_of(public), int.from_bytes(signature[32:], "little")
    if key is None or s >= L:
        return False
    h = int.from_bytes(hashlib.sha512(signature[:32] + public + message).digest(), "little") % L
    point = add(times(s, BASE), times(h, (P - key[0], key[1], 1, P - key[3])))
    x, y = (one * pow(point[2], P - 2, P) % P for one in point[:2])
    return (y | (x & 1) << 255).to_bytes(32, "little") == signature[:32]


def public_key(path):
    """The 32 bytes of a PEM file, and the key's id: SHA-256 of its DER form."""
    pem = re.fullmatch(r"-----BEGIN PUBLIC KEY-----\s+([A-Za-z0-9+/=\s]+)-----END PUBLIC KEY-----\s*", path.read_text(errors="replace"))
    der, head = from_base64("".join(pem[1].split()), str(path)) if pem else b"", bytes.fromhex("302a300506032b6570032100")
    if len(der) != 44 or not der.startswith(head):
        raise Refused(f"{path} is no public key of Ed25519 in PEM form")
    return der[len(head):], hashlib.sha256(der).hexdigest()


def from_base64(text, where):
    try:
        data = base64.b64decode(text, validate=True)
    except (ValueError, TypeError):
        raise Refused(f"{where} is not base64") from None
    if base64.b64encode(data).decode() != text:
        raise Refused(f"{where} is not base64 as it is written")
    return data


def path_of(folder, name):
    path = folder / name
    if path.is_symlink() or not path.is_file():
        raise Refused(f"{name} is not there")
    return path


def content(folder, name):
    if path_of(folder, name).stat().st_size > MOST_BYTES:
        raise Refused(f"{name} is too large")
    return (folder / name).read_bytes()


def hash_of(file, size):
    """Of the next so many bytes; empty where there are fewer."""
    sha = hashlib.sha256()
    while size > 0:
        piece = file.read(min(size, 1 << 16))
        if not piece:
            return ""
        sha.update(piece)
        size -= len(piece)
    return sha.hexdigest()


def file_hash(folder, name):
    path = path_of(folder, name)
    with path.open("rb") as file:
        return hash_of(file, path.stat().st_size)


def parsed(data, name):
    def once(pairs):
        if len({key for key, _ in pairs}) != len(pairs):
            raise Refused(f"{name} has a key twice")
        return dict(pairs)

    try:
        found = json.loads(data.decode(), object_pairs_hook=once)
    except (ValueError, RecursionError):
        found = None
    if not isinstance(found, dict):
        raise Refused(f"{name} is no JSON object")
    return found


def check_inputs(folder):
    """What the rows were computed from: each content has its hash for a name."""
    for name, digest in (one for files in parsed(content(folder, INPUTS), INPUTS)["tasks"].values() for one in files.items()):
        if not re.fullmatch("[0-9a-f]{64}", str(digest)) or file_hash(folder, f"inputs/{digest}") != digest:
            raise Refused(f"{name} of {INPUTS} is not what was kept")


def lies_in(folder, name, deeper=False):
    """Whether it names a file of that folder, or of one deeper in it, and leads nowhere else."""
    parts = name.split("/")
    return parts[0] == folder and (len(parts) == 2 or deeper and len(parts) > 2) and not {"", ".", ".."} & set(parts) and "\0" not in name


def check_seal(folder):
    """The artifact's id. Raises Refused where a file is not the one that was sealed."""
    seal = parsed(content(folder, SEAL), SEAL)
    files, runs = seal.get("files"), seal.get("runs")
    if seal.get("schema") != "takt.seal/1" or not isinstance(files, dict) or not isinstance(runs, dict):
        raise Refused("seal.json is no seal of this version (takt.seal/1)")
    if set(seal) != {"schema", "artifact_id", "files", "runs"} or set(files) - OPTIONAL != set(SEALED) or not all(lies_in("runs", name, True) for name in runs):
        raise Refused("seal.json is not as it was written")
    for name, digest in [*runs.items(), *files.items()]:
        if file_hash(folder, name) != digest:
            raise Refused(f"{name} is not the file that was sealed")
    if unsealed := [name for name in OPTIONAL - set(files) if (folder / name).exists()]:
        raise Refused(f"{unsealed[0]} is not in the seal")
    if INPUTS in files:
        check_inputs(folder)
    manifest = parsed(content(folder, "manifest.json"), "manifest.json")
    if manifest.get("complete") is not True or not seal["artifact_id"] or manifest.get("artifact_id") != seal["artifact_id"]:
        raise Refused("seal.json is of another artifact, or of an unfinished one")
    return seal["artifact_id"]


def check_rows(folder):
    """How many rows there are. Raises Refused where one is not the one that was written."""
    *rows, rest = content(folder, "rollouts.jsonl").split(b"\n")
    seals = content(folder, "rollouts.sha256").decode(errors="replace").split("\n")
    if rest or seals[-1:] != [""] or len(seals) - 1 != len(rows):
        raise Refused(f"{len(rows)} whole rows have {len(seals) - 1} seals in rollouts.sha256")
    before = ""
    for number, row in enumerate(rows, 1):
        if hashlib.sha256(before.encode() + b"\n" + row + b"\n").hexdigest() != seals[number - 1]:
            raise Refused(f"row {number} is not the one that was written")
        before = seals[number - 1]
    return len(rows)


def check_segments(folder, name, segments):
    if name == EVENTS and not segments:
        return
    path = path_of(folder, name)
    since, at = "its beginning", 0
    with path.open("rb") as file:
        for one in segments:
            until = datetime.datetime.fromtimestamp(one["until_unix_ns"] // 10**9, datetime.timezone.utc).strftime("%Y-%m-%dT%H:%M:%SZ")
            if hash_of(file, one["bytes"]) != one["sha256"]:
                raise Refused(f"{name} is not as it was recorded from {since} to {until} (from byte {at} on)")
            since, at = until, at + one["bytes"]
    if name != EVENTS and path.stat().st_size != at:
        raise Refused(f"{name} has {path.stat().st_size - at} bytes that were not recorded")


def check_run(folder):
    """The run's id and its number of segments. Raises Refused where a file is not as it was recorded."""
    seal = parsed(content(folder, SEAL), SEAL)
    files, grown = seal.get("files"), seal.get("segments")
    if seal.get("schema") != "takt.run_seal/1" or not isinstance(files, dict) or not isinstance(grown, dict) or {"can.log.zst" if name == "can.log" else name for name in grown} != set(GROWN):
        raise Refused("seal.json is no seal of this version (takt.run_seal/1)")
    if seal.get("closed") is not True:
        raise Refused("the recorder was ended before it closed the run")
    for name, digest in files.items():
        if name not in WHOLE and not lies_in("images", name):
            raise Refused("seal.json is not as it was written")
        if file_hash(folder, name) != digest:
            raise Refused(f"{name} is not the file that was recorded")
    for name, segments in grown.items():
        check_segments(folder, name, segments)
    manifest = parsed(content(folder, "manifest.json"), "manifest.json") if "manifest.json" in files else {}
    if manifest.get("run_id") != seal.get("run_id"):
        raise Refused("seal.json is of another run")
    before, digest = manifest.get("goes_on_from"), manifest.get("goes_on_from_seal_sha256")
    beside = folder.resolve().parent / str(before)
    if digest and "/" not in str(before) and before != ".." and (beside / SEAL).is_file() and file_hash(beside, SEAL) != digest:
        raise Refused(f"{before}, the part before it, has another seal than it had")
    return seal["run_id"], sum(map(len, grown.values()))


def check_signature(folder, key_file):
    """The id of the key. Raises Refused where the envelope is not signed by it, or a subject is another file."""
    public, key_id = public_key(key_file)
    envelope = parsed(content(folder, ENVELOPE), ENVELOPE)
    signatures = envelope.get("signatures")
    if envelope.get("payloadType") != PAYLOAD_TYPE or not isinstance(signatures, list):
        raise Refused(f"{ENVELOPE} is no DSSE envelope around an in-toto statement")
    payload = from_base64(envelope.get("payload"), f"the payload of {ENVELOPE}")
    message = f"DSSEv1 {len(PAYLOAD_TYPE)} {PAYLOAD_TYPE} {len(payload)} ".encode() + payload
    if not any(is_signature(public, message, from_base64(one.get("sig"), f"a signature of {ENVELOPE}")) for one in signatures[:16] if isinstance(one, dict)):
        raise Refused(f"{ENVELOPE} is not signed by that key")
    statement = parsed(payload, f"what {ENVELOPE} signs")
    subjects = statement.get("subject")
    if (statement.get("_type"), statement.get("predicateType")) != STATEMENT_TYPES or not isinstance(subjects, list):
        raise Refused(f"what {ENVELOPE} signs is no statement about a seal")
    named = {one["name"]: one["digest"] for one in subjects}
    if SEAL not in named or not all(name == SEAL or lies_in("postmortems", name) for name in named):
        raise Refused(f"what {ENVELOPE} signs does not name {SEAL}, or names what a seal does not cover")
    for name, digest in named.items():
        if digest != {"sha256": file_hash(folder, name)}:
            raise Refused(f"{name} is not the file that was signed")
    return key_id


def check_time(folder):
    """Whether a time stamp (RFC 3161) lies beside the envelope. Raises Refused where it does not name the envelope's SHA-256."""
    if not (folder / STAMP).exists():
        return False
    digest, response = hashlib.sha256(content(folder, ENVELOPE)).digest(), content(folder, STAMP)
    if not any(bytes.fromhex(head) + digest in response for head in IMPRINTS):
        raise Refused(f"{STAMP} does not stamp {ENVELOPE}")
    return True


def main(words):
    if len(words) not in (1, 3) or (len(words) == 3 and words[1] != "--key") or words[0].startswith("-"):
        print(__doc__.split("\n\n")[1], file=sys.stderr)
        return 64
    folder = pathlib.Path(words[0])
    try:
        # The signature first: where the seal itself was edited, it says so, and not that the files were.
        signed = f"signed by {check_signature(folder, pathlib.Path(words[2]))}" if len(words) == 3 else "no signature was checked"
        signed += f"; {STAMP} stamps it: by whom and when says openssl ts -verify" if len(words) == 3 and check_time(folder) else ""
        is_run = (folder / "ticks.mcap").exists()
        name, count = check_run(folder) if is_run else (check_seal(folder), check_rows(folder))
    except (Refused, OSError, ValueError, OverflowError, AttributeError, KeyError, TypeError) as refusal:
        print(f"{folder}: " + (str(refusal) if isinstance(refusal, (Refused, OSError)) else f"a file of it is not as Takt writes it: {refusal!r}"))
        return 1
    print(f"{name}: {count} {'segments' if is_run else 'rows'}, every file is the one that was sealed; {signed}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
