#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: what others wrote to try a format with goes through Takt, and no count of what succeeds falls.

Method: each suite's program runs over its folder, and its counts are compared with counts.json beside this file. A suite whose files are not there is not run.

usage: suites.py SOURCE_DIR BIN_DIR [--write]
  Suites that no package has are looked for in ../shared/suites, beside the checkout.
  --write: write counts.json and docs/suites.md anew. Exit codes: 0 no count fell, 1 one did, 77 no suite is there.
"""

import concurrent.futures
import json
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import tempfile
import time

SOURCE, PROGRAMS = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
COUNTS = SOURCE / "tests/suites/counts.json"
ONNX = pathlib.Path("/usr/share/libonnx-testdata/data")
SHARED = SOURCE.parent / "shared/suites"
GROWS = ("load", "built_in", "agree")  # of these none may fall
BAD_CONFIGURATION = 65
PAGE = """# Suites

What others wrote to try a format with, as Takt reads it.
`./dev suites` runs them and writes this page; CI runs them and refuses a count that falls (`tests/suites/counts.json`).

"""


def run(*words):
    done = subprocess.run([str(word) for word in words], capture_output=True, text=True, timeout=600)
    if done.returncode != 0:
        sys.exit(f"{words[0]}: {done.stderr or done.returncode}")
    return json.loads(done.stdout)


def onnx_runtime():
    found = sorted((SOURCE / "tests/node/node_modules/onnxruntime-node/bin").glob("*/linux/*/libonnxruntime.so.1"))
    here = [path for path in found if path.parent.name == {"x86_64": "x64", "aarch64": "arm64"}.get(platform.machine())]
    return here[-1] if here else None


def onnx():
    """Counts by kind of model, and the same in words."""
    if not ONNX.is_dir():
        return None
    library, began = onnx_runtime(), time.monotonic()
    report = run(PROGRAMS / "takt-suite-onnx", ONNX, *([library] if library else []))
    seconds = time.monotonic() - began
    counts = {f"onnx {kind}": {key: one[key] for key in ("models", *GROWS)} for kind, one in report.items()}
    if library is None:  # then only what the built-in engine takes loads
        for one in counts.values():
            del one["load"], one["agree"]
    worst = max(one["built_in_error"] for one in report.values())
    text = f"""## ONNX

The standard's own models and vectors (Debian's `libonnx-testdata`), each by the engine that auto takes.
Agrees: every output within 1e-5 of the standard's, |a - b| / max(1, |b|); NaN against a number never does.
Largest error of the built-in engine among those: {worst:.1e}.
Both NaN: {sum(one["both_nan"] for one in report.values())} outputs.
Time: {seconds:.0f} s.

| kind | models | load | of these built-in | agree | not compared |
|---|---|---|---|---|---|
"""
    for kind, one in report.items():
        text += f"| {kind} | {one['models']} | {one['load']} | {one['built_in']} | {one['agree']} | {one['not_compared']} |\n"
    apart = [name for one in report.values() for name in (one["apart"] or {})]
    by_builtin = sorted(name.split()[1] for name in apart if name.startswith("builtin"))
    text += f"""
Not compared: outputs whose number no shape says.
Beyond 1e-5: {len(apart)}, {len(by_builtin)} of them by the built-in engine ({', '.join(by_builtin) or 'none'}).
The others are ONNX Runtime's own answers: random numbers, training, resizing, windows and transforms.
"""
    return counts, text


def answered(file):
    """Whether a file that is no robot is refused by that, in plain lines."""
    done = subprocess.run([PROGRAMS / "takt", "config", "check", file], capture_output=True, timeout=120, check=False)
    said = done.stdout + done.stderr
    return done.returncode == BAD_CONFIGURATION and len(said) > 0 and all(byte >= 0x20 or byte == 0x0A for byte in said)


def files_of(name, pattern):
    """Those of a suite that no package has."""
    files = sorted((SHARED / name).glob(pattern))
    if not files and os.environ.get("TAKT_REQUIRE_SHARED") == "1":
        sys.exit(f"{SHARED / name} is missing: TAKT_REQUIRE_SHARED is set")
    return files


def yaml():
    files = files_of("yaml", "*.yaml")
    if not files:
        return None
    with concurrent.futures.ThreadPoolExecutor(2) as pool:
        good = sum(pool.map(answered, files))
    text = f"""## YAML

The inputs of yaml-test-suite as robot files, which none of them is.
Answered: `takt config check` refuses it in plain lines, exit code 65.

| inputs | of these no YAML | answered |
|---|---|---|
| {len(files)} | {len(list((SHARED / "yaml").glob("*.error")))} | {good} |
"""
    return {"yaml": {"models": len(files), "agree": good}}, text


def json_texts():
    files = files_of("json", "*.json")
    if not files:
        return None
    is_read = run(PROGRAMS / "takt-suite-files", "json", SHARED / "json")
    wanted = {"y": True, "n": False}
    apart = sorted(file.name for file in files if file.name[0] in wanted and is_read[file.name] != wanted[file.name[0]])
    may, must, never = (sum(file.name[0] == first for file in files) for first in "iyn")
    text = f"""## JSON

JSONTestSuite, by the reader of manifests, artifacts and run folders.
A key that stands twice in an object is refused, although JSON allows it: two readers could take either.
Read otherwise than the suite says: {", ".join(apart) or "none"}.

| texts | must be read | must be refused | left open, of these read | as the suite says |
|---|---|---|---|---|
| {len(files)} | {must} | {never} | {may}, {sum(is_read[file.name] for file in files if file.name[0] == "i")} | {must + never - len(apart)} |
"""
    return {"json": {"models": len(files), "agree": must + never - len(apart)}}, text


def is_as_described(description, read):
    """Whether a file was read whole, with each message and each metadata record that its description has."""
    channels, schemas, wanted, metadata = {}, {"0": ""}, [], {}
    for record in description["records"]:
        fields = dict(record["fields"])
        if record["type"] == "DataEnd":
            break
        if record["type"] == "Schema":
            schemas[fields["id"]] = fields["name"]
        elif record["type"] == "Channel":
            channels[fields["id"]] = (fields["topic"], schemas[fields["schema_id"]])
        elif record["type"] == "Metadata":
            metadata.update(fields["metadata"])
        elif record["type"] == "Message":
            topic, schema = channels[fields["channel_id"]]
            wanted.append([topic, int(fields["log_time"]), schema, bytes(map(int, fields["data"])).hex()])
    return isinstance(read, dict) and read["whole"] and read["messages"] == wanted and metadata.items() <= (read["metadata"] or {}).items()


def mcap():
    files = files_of("mcap", "*.json")
    writer = SOURCE / "tests/node/mcap_suite.mjs"
    if not files or not shutil.which("node") or not (writer.parent / "node_modules").is_dir():
        return None
    with tempfile.TemporaryDirectory(prefix="takt-mcap.") as folder:
        run("node", writer, SHARED / "mcap", folder)
        read = run(PROGRAMS / "takt-suite-files", "mcap", folder)
    apart = [file.stem for file in files if not is_as_described(json.loads(file.read_text()), read.get(f"{file.stem}.mcap"))]
    text = f"""## MCAP

The conformance suite's files, written from their descriptions by MCAP's reference library.
Their SHA-256 is that of the suite's own.
As described: read whole, with every message (topic, schema, time, bytes) and all metadata.
Read otherwise: {", ".join(apart) or "none"}.

| files | as described |
|---|---|
| {len(files)} | {len(files) - len(apart)} |
"""
    return {"mcap": {"models": len(files), "agree": len(files) - len(apart)}}, text


def ed25519():
    files = files_of("ed25519", "*.json")
    if not files:
        return None
    sys.path.insert(0, str(SOURCE / "lab/artifact"))
    sys.dont_write_bytecode = True
    import verify_seal
    cases = [(bytes.fromhex(group["publicKey"]["pk"]), case) for file in files for group in json.loads(file.read_text())["testGroups"] for case in group["tests"]]
    good = sum(verify_seal.is_signature(key, bytes.fromhex(case["msg"]), bytes.fromhex(case["sig"])) == (case["result"] == "valid") for key, case in cases)
    text = f"""## Ed25519

Wycheproof's signatures, by the verifier of seals (`lab/artifact/verify_seal.py`).

| signatures | judged as the suite says |
|---|---|
| {len(cases)} | {good} |
"""
    return {"ed25519": {"models": len(cases), "agree": good}}, text


def main():
    made = [one for one in (onnx(), yaml(), json_texts(), mcap(), ed25519()) if one]
    if not made:
        print("NOT TESTED: no suite is there (libonnx-testdata, ../shared/suites)", file=sys.stderr)
        sys.exit(77)
    counts, page = {}, PAGE + "\n".join(text for _, text in made)
    for some, _ in made:
        counts.update(some)
    print(page)
    if "--write" in sys.argv:
        COUNTS.write_text(json.dumps(counts, indent=1) + "\n")
        (SOURCE / "docs/suites.md").write_text(page)
        return
    fallen = [f"{suite}: {key} fell from {before} to {counts[suite][key]}"
              for suite, known in json.loads(COUNTS.read_text()).items() for key, before in known.items()
              if key in counts.get(suite, {}) and counts[suite][key] < before]
    for line in fallen:
        print(line, file=sys.stderr)
    sys.exit(1 if fallen else 0)


if __name__ == "__main__":
    main()
