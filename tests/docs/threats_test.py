#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: no threat of docs/threats.md without a test, and no test of a threat without its row. Method: each row's test carries the comment
`Threat: ID` right above it, and each such comment in tests/ is a row's. Usage: threats_test.py SOURCE"""
import pathlib
import re
import sys

ROW = re.compile(r"^\| `([a-z-]+)` \|.*\| \[(\w+)\]\(\.\./(tests/[\w/.]+)\) \|$", re.M)
TAG = re.compile(r"^\s*(?://|#) Threat: ([a-z-]+)\n\s*(?:TEST(?:_F|_P)?\(\w+, |def )(\w+)\W", re.M)


def main():
    source = pathlib.Path(sys.argv[1])
    page = (source / "docs/threats.md").read_text()
    rows = [match.groups() for match in ROW.finditer(page)]
    tags = [(match[1], match[2], str(file.relative_to(source)))
            for file in sorted((source / "tests").rglob("*")) if file.suffix in (".cpp", ".py") and "node_modules" not in file.parts
            for match in TAG.finditer(file.read_text())]
    wrong = [f"docs/threats.md: {row} has no such test, or it no comment `Threat: {row[0]}`" for row in rows if row not in tags]
    wrong += [f"{tag}: has no row in docs/threats.md" for tag in tags if tag not in rows]
    if len(rows) != page.count("\n| `"):
        wrong.append("docs/threats.md: a row that is not of the form | `id` | ... | [Test](../tests/FILE) |")
    if len({row[0] for row in rows}) != len(rows):
        wrong.append("docs/threats.md: two rows of one id")
    print("\n".join(wrong) or f"{len(rows)} threats, each with its test")
    return 1 if wrong or not rows else 0


sys.exit(main())
