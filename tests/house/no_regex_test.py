#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: no text of a stranger's meets std::regex, whose depth grows with the text until the stack ends. Method: no
source of the product includes <regex>; tests may, for their texts are ours.
Usage: no_regex_test.py SOURCE_FOLDER"""
import pathlib
import subprocess
import sys

root = pathlib.Path(sys.argv[1])
listed = subprocess.run(["git", "-C", str(root), "ls-files", "*.cpp", "*.hpp", "*.h"], capture_output=True, text=True)
if listed.returncode != 0:
    sources = [path.relative_to(root) for kind in ("*.cpp", "*.hpp", "*.h") for path in root.rglob(kind)]
else:
    sources = [pathlib.Path(line) for line in listed.stdout.splitlines()]
product = [path for path in sources if path.parts[0] not in ("tests", "build")]
found = [path for path in product if (root / path).exists() and "<regex>" in (root / path).read_text()]
assert product, "no sources found"
for path in found:
    print(f"{path}: includes <regex>; read the text by hand or by a library")
sys.exit(1 if found else 0)
