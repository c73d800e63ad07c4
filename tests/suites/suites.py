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
import subprocess
import sys
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


def yaml():
    files = sorted((SHARED / "yaml").glob("*.yaml"))
    if not files and os.environ.get("TAKT_REQUIRE_SHARED") == "1":
        sys.exit(f"{SHARED / 'yaml'} is missing: TAKT_REQUIRE_SHARED is set")
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


def main():
    made = [one for one in (onnx(), yaml()) if one]
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
