#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the packages say what is in them. Method: the list that the build writes is held against the programs' own and against the
copyright file; and versions of commits are held against dpkg. Usage: contents_test.py SOURCE BIN_DIR. Exit code 77: no dpkg."""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

BUILT_IN = {"nlohmann-json3-dev": "nlohmann-json", "libcli11-dev": "CLI11", "libeigen3-dev": "Eigen", "libjs-dygraphs": "dygraphs",
            "libboost-dev": "Boost.Math"}


def main():
    source, bin_dir = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    if not shutil.which("dpkg-query"):
        return 77
    copyright_file = (source / "cmake/package/copyright").read_text()
    with tempfile.TemporaryDirectory() as folder:
        out = pathlib.Path(folder) / "list.json"
        subprocess.run([source / "cmake/package/sbom.py", "0.2.0", "1 Dec 2026", out, bin_dir], check=True)
        told = json.loads(out.read_text())
        subprocess.run([source / "cmake/package/sbom.py", "0.2.0", "1 Dec 2026", out, bin_dir], check=True)
        assert told == json.loads(out.read_text()), "the same programs give another list"
    ids = {one["SPDXID"] for one in told["packages"]}
    assert len(ids) == len(told["packages"]) and all(one["versionInfo"] for one in told["packages"])
    related = {one["relatedSpdxElement"]: one["relationshipType"] for one in told["relationships"]}
    assert set(related) == ids, "every package stands in a relation"
    names = {one["name"] for one in told["packages"]}
    assert {"libc6", "libyaml-cpp0.7", "libssl3"} <= names, names
    for package, name in BUILT_IN.items():
        assert related["SPDXRef-" + package] == "CONTAINS"
        paragraph = re.search(rf"^Files: {name}/\*\nCopyright: .*\n(?: .*\n)*License: (\S+)\n", copyright_file, re.M)
        assert paragraph, f"no paragraph about {name}"
        assert re.search(rf"^License: {re.escape(paragraph[1])}\n ", copyright_file, re.M), f"no text of {paragraph[1]}"
    return 0


if __name__ == "__main__":
    sys.exit(main())
