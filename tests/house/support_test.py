#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: tests make temporary directories and read whole files in one way, that of tests/support. Method: no other C++
source under tests calls mkdtemp, or reads a file by std::istreambuf_iterator or rdbuf(); each, planted, must be found.
Usage: support_test.py SOURCE_FOLDER"""
import pathlib
import re
import sys

INSTEAD = {
    r"\bmkdtemp\(": "use TemporaryDirectory of tests/support/temporary_directory.hpp",
    r"\bistreambuf_iterator\b|\brdbuf\(\)": "use text_of of tests/support/files.hpp",
}
EXCEPT = {
    "tests/fuzz/scratch.hpp": "in memory, and a target of the fuzzer ends without destructors",
}


def findings(path, text):
    """Sentences about one file; `path` is below the source folder."""
    if path.startswith("tests/support/") or path in EXCEPT:
        return []
    return [f"{path}: {advice}" for call, advice in INSTEAD.items() if re.search(call, text)]


root = pathlib.Path(sys.argv[1])
sources = [file for kind in ("*.cpp", "*.hpp") for file in sorted((root / "tests").rglob(kind))]
found = [sentence for file in sources for sentence in findings(file.relative_to(root).as_posix(), file.read_text())]
assert len(sources) > 300, f"only {len(sources)} sources were read"
for planted in ("mkdtemp(pattern.data())", "std::istreambuf_iterator<char>(file)", "text << file.rdbuf()"):
    assert len(findings("tests/cli/planted.cpp", planted)) == 1, f"a planted {planted} was not found"
print("\n".join(found + [f"{len(sources)} sources, {len(found)} findings"]))
sys.exit(1 if found else 0)
