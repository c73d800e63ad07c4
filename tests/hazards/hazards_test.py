#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: docs/hazards.md is what the hazard table and the measured reaction times say, and every test that the table calls
a proof is there, runs and passes. Method: the page is made again and compared; each proof's program is run with a
filter, and its report must have the case, completed, without a failure; a proof that is skipped, disabled or missing
is none. A proof that is planted must be found missing. A mutant that a row names beside its proof is a fault of
tests/mutants/faults.toml; that the proof notices it, `./dev mutants` shows. Usage: hazards_test.py REPOSITORY BIN_FOLDER.
Exit codes: 0 fine, 1 not.
"""
import collections
import difflib
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib


def wanted(case):
    """Plain, or of a suite with parameters: Each/Suite.Case/0."""
    return f"{case}:*/{case}/*:{case}/*:*/{case}"


def is_of(suite, name, case):
    return f"{suite.split('/')[-1] if '/' in suite else suite}.{name.split('/')[0]}" == case


def results(program, cases, root):
    """Of every case that ran: "passed", or what else became of it."""
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "report.json"
        subprocess.run([program, "--gtest_filter=" + ":".join(map(wanted, cases)), f"--gtest_output=json:{report}"], cwd=root,
                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)
        suites = json.loads(report.read_text())["testsuites"] if report.exists() else []
    found = collections.defaultdict(list)
    for suite in suites:
        for test in suite["testsuite"]:
            for case in cases:
                if is_of(suite["name"], test["name"], case):
                    found[case].append("failed" if test.get("failures") else test["result"])
    return found


def problems_with(proofs, root, programs):
    by_program = collections.defaultdict(list)
    for proof in proofs:
        program, case = proof.split(" ")
        by_program[program].append(case)
    for program, cases in sorted(by_program.items()):
        path = programs / program
        found = results(path, cases, root) if path.exists() else {}
        for case in cases:
            outcome = set(found.get(case, ["not there"]))
            if outcome != {"COMPLETED"}:
                yield f"{program} {case}: {', '.join(sorted(outcome))}"


def unknown_mutants(lines, root):
    faults = {fault["name"] for fault in tomllib.loads((root / "tests/mutants/faults.toml").read_text())["fault"]}
    named = {line.split("\t")[0] for line in lines}
    return [f"tests/hazards names a mutant that tests/mutants/faults.toml does not have: {name}" for name in sorted(named - faults)]


def stale(root, page):
    kept = root / "docs/hazards.md"
    difference = difflib.unified_diff(kept.read_text().splitlines(), page.splitlines(), "docs/hazards.md", "as it is now", lineterm="")
    lines = list(difference)
    return lines and lines + ["docs/hazards.md is out of date: build/release/bin/hazard_page >docs/hazards.md"]


def main(root, programs):
    maker = programs / "hazard_page"
    proofs = subprocess.run([maker, "--proofs"], capture_output=True, text=True, check=True).stdout.splitlines()
    problems = list(problems_with(proofs, root, programs))
    planted = [proofs[0] + "ThatIsNotThere", "no_such_test Suite.Case"]
    assert len(list(problems_with(planted, root, programs))) == 2, "a planted proof was taken for one"
    mutants = subprocess.run([maker, "--mutants"], capture_output=True, text=True, check=True).stdout.splitlines()
    problems += unknown_mutants(mutants, root)
    assert len(unknown_mutants(["no such fault\tno_such_test Suite.Case"], root)) == 1, "a planted mutant was taken for one"
    made = subprocess.run([maker], cwd=root, capture_output=True, text=True, check=False)
    problems += [made.stderr.strip()] if made.returncode else stale(root, made.stdout) or []
    print("\n".join(problems) or f"{len(proofs)} proofs hold, {len(mutants)} rows name a mutant, and the page is up to date")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()))
