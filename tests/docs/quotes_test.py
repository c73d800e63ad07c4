#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a search of docs/troubleshooting.md for a sentence of a program finds its row, and the page stays short.
Method: each code span of a table's first column must be in a string of one source file of the programs, adjacent strings
joined; `...` stands for what the program fills in. Commands that a span may name instead begin with `takt `. A quote that
is planted must be found missing. The page has at most 40 rows.
Usage: quotes_test.py REPOSITORY. Exit codes: 0 fine, 1 not: a line per finding.
"""
import pathlib
import re
import sys

PAGE = "docs/troubleshooting.md"
ROOMS = ("executive", "config", "dds", "drivers", "commissioning", "policy_host", "client", "sensors", "monitor", "simulation", "evidence", "systemd", "cli")
MOST_ROWS = 40


def rows(text):
    """(line number, cells) of each row of a table, its head aside."""
    lines = text.splitlines()
    for number, line in enumerate(lines, 1):
        is_head = number < len(lines) and re.match(r"\|[-|]+\|$", lines[number])
        if line.startswith("| ") and not is_head:
            yield number, [cell.strip() for cell in line.strip("|").split("|")]


def said(path):
    """All that a source file's strings say: adjacent strings are one; others are kept apart."""
    text = re.sub(r"(?m)^\s*(//|#include).*$", "", path.read_text())
    joined = re.sub(r'"\s*"', "", text.replace('""', "\0"))
    return "\n".join(string.replace('\\"', '"') for string in re.findall(r'"((?:[^"\\\n]|\\.)*)"', joined))


def is_said(quote, files):
    parts = [part.strip() for part in quote.split("...") if part.strip()]
    return bool(parts) and any(all(part in words for part in parts) for words in files)


def missing(text, files):
    for number, cells in rows(text):
        for quote in re.findall(r"`([^`]+)`", cells[0]):
            if not quote.startswith("takt ") and not is_said(quote, files):
                yield f"{PAGE}:{number}: no program says `{quote}`: quote what it says now"


def main():
    root = pathlib.Path(sys.argv[1])
    files = [said(path) for room in ROOMS for path in sorted((root / room).rglob("*.[ch]pp"))]
    text = (root / PAGE).read_text()
    problems = list(missing(text, files))
    planted = "| `no fresh command: the moon is full` | x |\n| `interface is down` | x |\n"
    assert [line.split(":")[1] for line in missing(planted, files)] == ["1"], "a planted quote was taken for one"
    count = len(list(rows(text)))
    problems += [f"{PAGE}: {count} rows, {MOST_ROWS} are enough"] if count > MOST_ROWS else []
    print("\n".join(problems) or f"{count} rows quote what the programs say")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
