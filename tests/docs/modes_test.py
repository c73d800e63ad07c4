#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: docs/modes.md is what the tick does, as it is measured now, and every test that it names is there, runs and
passes. Method: the page is made again and compared; each named test runs with a filter, as those of docs/hazards.md do
(tests/hazards/hazards_test.py). A proof that is planted must be found missing.
Usage: modes_test.py REPOSITORY BIN_FOLDER. Exit codes: 0 fine, 1 not.
"""
import difflib
import pathlib
import subprocess
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "hazards"))
from hazards_test import problems_with  # noqa: E402


def stale(root, made):
    kept = (root / "docs/modes.md").read_text().splitlines()
    lines = list(difflib.unified_diff(kept, made.splitlines(), "docs/modes.md", "as it is now", lineterm=""))
    return lines and lines + ["docs/modes.md is out of date: build/release/bin/mode_page >docs/modes.md"]


def main(root, programs):
    maker = programs / "mode_page"
    proofs = subprocess.run([maker, "--proofs"], cwd=root, capture_output=True, text=True, check=True).stdout.splitlines()
    problems = list(problems_with(proofs, root, programs))
    planted = [proofs[0] + "ThatIsNotThere", "no_such_test Suite.Case"]
    assert len(list(problems_with(planted, root, programs))) == 2, "a planted proof was taken for one"
    made = subprocess.run([maker], cwd=root, capture_output=True, text=True, check=False)
    problems += [made.stderr.strip()] if made.returncode else stale(root, made.stdout) or []
    print("\n".join(problems) or f"{len(proofs)} proofs hold, and the page is up to date")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()))
