#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Says whether an artifact of `takt panel`, or a run folder, is the one that was sealed, and signed, without any code of Takt's.

Usage: verify_seal.py DIR [--key PUBLIC.pem]
Exit codes: 0 it is; 1 it is not, with the reason; 64 command line.

Of an artifact it reads seal.json (SHA-256 of every file) and rollouts.sha256 (a chain: each row's line is SHA-256 over the line before,
a line end, and the row with its line end); of a run folder seal.json (SHA-256 of each whole file, and of each 10 s of those that grew);
with --key seal.dsse.json: a DSSE envelope (version 1) around an in-toto Statement v1, signed by Ed25519. The signature is judged by
RFC 8032, section 5.1.7, strictly: one encoding of each number, no cofactor.
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
INPUTS = "inputs.json"  # an earlier version keeps none
PAYLOAD_TYPE = "application/vnd.in-toto+json"
STATEMENT_TYPE = "https://in-toto.io/Statement/v1"
PREDICATE_TYPE = "https://in-toto.io/attestation/test-result/v0.1"
MOST_BYTES = 4 << 30
EVENTS = "events.jsonl"  # its writer goes on when the run is closed; absent where nothing wrote it
GROWN = ("ticks.mcap", "can.log.zst", "transitions.jsonl", EVENTS)  # "can.log" of earlier versions: the same lines, plain
WHOLE = ("manifest.json", "config.yaml", "drives.json")

# The curve of RFC 8032, section 5.1.
P = 2**255 - 19
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
    inverse = pow(point[2], P - 2, P)
    x, y = point[0] * inverse % P, point[1] * inverse % P
    return (y | (x & 1) << 255).to_bytes(32, "little") == signature[:32]


def public_key(path):
    """The 32 bytes of a PEM file, and the key's id: SHA-256 of its DER form."""
    lines = [line.strip() for line in path.read_text(errors="replace").splitlines()]
    if lines[:1] != ["-----BEGIN PUBLIC KEY-----"] or "-----END PUBLIC KEY-----" not in lines:
        raise Refused(f"{path} is no public key in PEM form")
    der = from_base64("".join(lines[1:lines.index("-----END PUBLIC KEY-----")]), str(path))
    head = bytes.fromhex("302a300506032b6570032100")
    if len(der) != 44 or not der.startswith(head):
        raise Refused(f"{path} is no key of Ed25519")
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
        raise Refused(f"{name} is no JSON") from None
    if not isinstance(found, dict):
        raise Refused(f"{name} is no object")
    return found


def check_inputs(folder, sealed):
    """What the rows were computed from: each content has its hash for a name."""
    if INPUTS not in sealed:
        raise Refused(f"{INPUTS} is not in the seal")
    for name, digest in (one for files in parsed(content(folder, INPUTS), INPUTS)["tasks"].values() for one in files.items()):
        if not re.fullmatch("[0-9a-f]{64}", str(digest)) or file_hash(folder, f"inputs/{digest}") != digest:
            raise Refused(f"{name} of {INPUTS} is not what was kept")


def may_be_of_run(name):
    parts = pathlib.PurePosixPath(name).parts
    return parts[:1] == ("runs",) and ".." not in parts and "\0" not in name


def check_seal(folder):
    """The artifact's id. Raises Refused where a file is not the one that was sealed."""
    seal = parsed(content(folder, "seal.json"), "seal.json")
    files, runs = seal.get("files"), seal.get("runs")
    if seal.get("schema") != "takt.seal/1" or not isinstance(files, dict) or not isinstance(runs, dict):
        raise Refused("seal.json is no seal of this version (takt.seal/1)")
    if set(seal) != {"schema", "artifact_id", "files", "runs"} or set(files) - {INPUTS} != set(SEALED) or not all(map(may_be_of_run, runs)):
        raise Refused("seal.json is not as it was written")
    for name, digest in [*runs.items(), *files.items()]:
        if file_hash(folder, name) != digest:
            raise Refused(f"{name} is not the file that was sealed")
    if (folder / INPUTS).exists():
        check_inputs(folder, files)
    manifest = parsed(content(folder, "manifest.json"), "manifest.json")
    if manifest.get("complete") is not True:
        raise Refused("the artifact is unfinished")
    if not seal["artifact_id"] or manifest.get("artifact_id") != seal["artifact_id"]:
        raise Refused("seal.json is of another artifact")
    return seal["artifact_id"]


def check_rows(folder):
    """How many rows there are. Raises Refused where one is not the one that was written."""
    *rows, rest = content(folder, "rollouts.jsonl").split(b"\n")
    seals = content(folder, "rollouts.sha256").decode(errors="replace").split("\n")
    if seals[-1:] != [""] or len(seals) - 1 != len(rows):
        raise Refused(f"{len(rows)} rows have {len(seals) - 1} seals in rollouts.sha256")
    if rest:
        raise Refused("the last row is cut off")
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
    seal = parsed(content(folder, "seal.json"), "seal.json")
    files, grown = seal.get("files"), seal.get("segments")
    if seal.get("schema") != "takt.run_seal/1" or not isinstance(files, dict) or not isinstance(grown, dict) or {"can.log.zst" if name == "can.log" else name for name in grown} != set(GROWN):
        raise Refused("seal.json is no seal of this version (takt.run_seal/1)")
    if seal.get("closed") is not True:
        raise Refused("the recorder was ended before it closed the run")
    for name, digest in files.items():
        image = pathlib.PurePosixPath(name).parts
        if name not in WHOLE and (len(image) != 2 or image[0] != "images" or image[1] == ".." or "\0" in name):
            raise Refused("seal.json is not as it was written")
        if file_hash(folder, name) != digest:
            raise Refused(f"{name} is not the file that was recorded")
    for name, segments in grown.items():
        shape = (("bytes", int), ("until_unix_ns", int), ("sha256", str))
        if not isinstance(segments, list) or any(not isinstance(one, dict) or any(type(one.get(key)) is not kind for key, kind in shape) for one in segments):
            raise Refused("seal.json is not as it was written")
        check_segments(folder, name, segments)
    manifest = parsed(content(folder, "manifest.json"), "manifest.json") if "manifest.json" in files else {}
    if manifest.get("run_id") != seal.get("run_id"):
        raise Refused("seal.json is of another run")
    before, digest = manifest.get("goes_on_from"), manifest.get("goes_on_from_seal_sha256")
    beside = folder.resolve().parent / str(before) / "seal.json"
    if digest and "/" not in str(before) and before != ".." and beside.is_file():
        with beside.open("rb") as file:
            if hash_of(file, beside.stat().st_size) != digest:
                raise Refused(f"{before}, the part before it, has another seal than it had")
    return seal["run_id"], sum(map(len, grown.values()))


def may_be_subject(name):
    path = pathlib.PurePosixPath(name)
    return name == "seal.json" or (len(path.parts) == 2 and path.parts[0] == "postmortems" and path.parts[1] not in ("..", ".")
                                   and str(path) == name and "\0" not in name)


def check_signature(folder, key_file):
    """The id of the key. Raises Refused where the envelope is not signed by it, or a subject is another file."""
    public, key_id = public_key(key_file)
    envelope = parsed(content(folder, "seal.dsse.json"), "seal.dsse.json")
    signatures = envelope.get("signatures")
    if envelope.get("payloadType") != PAYLOAD_TYPE or not isinstance(signatures, list):
        raise Refused("seal.dsse.json is no DSSE envelope around an in-toto statement")
    payload = from_base64(envelope.get("payload"), "the payload of seal.dsse.json")
    message = f"DSSEv1 {len(PAYLOAD_TYPE)} {PAYLOAD_TYPE} {len(payload)} ".encode() + payload
    if not any(is_signature(public, message, from_base64(one.get("sig"), "a signature")) for one in signatures[:16] if isinstance(one, dict)):
        raise Refused("it is not signed by that key")
    statement = parsed(payload, "what is signed")
    subjects = statement.get("subject")
    if statement.get("_type") != STATEMENT_TYPE or statement.get("predicateType") != PREDICATE_TYPE or not isinstance(subjects, list):
        raise Refused("what is signed is no statement about a seal")
    for subject in subjects:
        name = subject.get("name") if isinstance(subject, dict) else None
        if not isinstance(name, str) or not may_be_subject(name):
            raise Refused("the signed statement names a file that is no part of a seal")
        if subject.get("digest") != {"sha256": file_hash(folder, name)}:
            raise Refused(f"{name} is not the file that was signed")
    if all(subject["name"] != "seal.json" for subject in subjects):
        raise Refused("the signed statement does not name seal.json")
    return key_id


def main(words):
    if len(words) not in (1, 3) or (len(words) == 3 and words[1] != "--key") or words[0].startswith("-"):
        print(__doc__.split("\n\n")[1], file=sys.stderr)
        return 64
    folder = pathlib.Path(words[0])
    try:
        is_run = (folder / "ticks.mcap").exists()
        name, count = check_run(folder) if is_run else (check_seal(folder), check_rows(folder))
        key_id = check_signature(folder, pathlib.Path(words[2])) if len(words) == 3 else None
    except (Refused, OSError, ValueError, OverflowError, AttributeError, KeyError, TypeError) as refusal:
        print(f"{folder}: {refusal}")
        return 1
    print(f"{name}: {count} {'segments' if is_run else 'rows'}, every file is the one that was sealed; " + (f"signed by {key_id}" if key_id else "no signature was checked"))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
