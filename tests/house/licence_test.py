#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: every file says under which licence it is. Method: each tracked file holds the SPDX line in its first lines
or is named in REUSE.toml; that file names no program's source, and no path that is not there.
Usage: licence_test.py SOURCE_FOLDER"""
import fnmatch
import pathlib
import subprocess
import sys
import tomllib

LINE = "SPDX-License-Identifier: Apache-2.0"
SOURCES = {".cpp", ".hpp", ".c", ".h", ".py", ".sh", ".js", ".mjs", ".css", ".idl", ".msg", ".cmake", ".service"}

root = pathlib.Path(sys.argv[1])
listed = subprocess.run(["git", "-C", str(root), "ls-files"], capture_output=True, text=True)
if listed.returncode != 0:
    print("no git here: the list of files is not known")
    sys.exit(0)
files = [path for path in listed.stdout.splitlines() if (root / path).exists()]
assert files, "no files found"
named = [glob for table in tomllib.loads((root / "REUSE.toml").read_text())["annotations"] for glob in table["path"]]

wrong = []
for path in files:
    says = LINE in (root / path).read_bytes()[:300].decode(errors="replace")
    by_name = any(fnmatch.fnmatch(path, glob.replace("**", "*")) for glob in named)
    source = pathlib.Path(path).suffix in SOURCES or pathlib.Path(path).name == "CMakeLists.txt"
    if not says and (source or (not by_name and path != "LICENSE")):
        wrong.append(f'{path}: write "{LINE}" into its first lines')
for glob in named:
    if not any(fnmatch.fnmatch(path, glob.replace("**", "*")) for path in files):
        wrong.append(f"REUSE.toml: {glob} names no file")
print("\n".join(wrong))
sys.exit(1 if wrong else 0)
