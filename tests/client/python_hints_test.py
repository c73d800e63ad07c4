#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a user who checks a policy's types is helped by the package's hints, not hindered. Method: mypy, as strict as it gets, over the package, over the policy of
docs/python-policy.md with a typed network, and over a program that reads a run. Usage: python_hints_test.py SOURCE_DIR. Exit code 77: mypy is missing.
"""
import os
import pathlib
import subprocess
import sys
import tempfile

SOURCE = pathlib.Path(sys.argv[1]).resolve()
NETWORK = """
import numpy as np
from numpy.typing import NDArray


def net(state: NDArray[np.float32], top: NDArray[np.uint8], *, prefix: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.repeat(state[:1], 100, axis=0)


"""
READER = """
import takt

run: takt.Run = takt.open("run")
print(run.ticks["age_ms"].max(), run.sensors["values"], run.image("").shape, takt.open("panel").rows)
"""


def complaints(*files):
    # pandas 1.5 has no hints of its own.
    done = subprocess.run(["/usr/bin/python3", "-m", "mypy", "--strict", "--ignore-missing-imports", "--cache-dir", os.devnull, *files], cwd=SOURCE / "client/python",
                          capture_output=True, text=True, check=False)
    if "No module named mypy" in done.stderr:
        print("SKIPPED: python3-mypy is missing: NO HINT WAS CHECKED")
        sys.exit(77)
    return done.stdout if done.returncode else ""


def main():
    page = (SOURCE / "docs/python-policy.md").read_text()
    policy = page.split("## Write it")[1].split("```python\n")[1].split("```")[0]
    with tempfile.TemporaryDirectory() as folder:
        policy_file, reader_file = pathlib.Path(folder) / "policy.py", pathlib.Path(folder) / "reader.py"
        policy_file.write_text(NETWORK + policy)
        reader_file.write_text(READER)
        found = complaints("takt", policy_file, reader_file)
        policy_file.write_text(NETWORK + policy.replace("obs.publish(q=actions)", "obs.publish(actions)"))
        if not found and "Too many positional arguments" not in complaints(policy_file):
            found = "a call that cannot be meant was not found"
    print(found or "no complaints")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
