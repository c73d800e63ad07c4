#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a newcomer finds every page, no link leads nowhere, no merge left its marks, and the first page stays short.
Method: links of README.md and of docs/*.md are followed on disk; docs/README.md names every page; README.md has at most
120 lines of at most 120 columns; no line of a page or of the changelog is a conflict's mark; a release has at most 40 lines in the
changelog, which begin with what breaks. Usage: pages_test.py REPOSITORY. Exit codes: 0 fine, 1 not.
"""
import pathlib
import re
import sys

MOST_LINES = MOST_COLUMNS = 120
MOST_LINES_OF_A_RELEASE = 40
CONTRIBUTORS_PAGES = ("drivers/protocol/README.md", "tests/mutants/README.md")


def broken_links(page):
    for target in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text()):
        if not re.match(r"[a-z]+:", target) and not (page.parent / target).exists():
            yield f"{page}: {target} is not there"


def merge_marks(page):
    for number, line in enumerate(page.read_text().splitlines(), 1):
        if re.match(r"(<{7}|={7}|>{7})( |$)", line):
            yield f"{page}:{number}: a merge left its mark"


def releases(changelog):
    for section in re.split(r"(?m)^## ", changelog.read_text())[1:]:
        name, *lines = section.rstrip().splitlines()
        if len(lines) + 1 > MOST_LINES_OF_A_RELEASE:
            yield f"{changelog}: {name} has {len(lines) + 1} lines, {MOST_LINES_OF_A_RELEASE} are enough: the history has the rest"
        heads = [line for line in lines if re.match(r"[A-Z][^.]*:$", line)]
        if heads and heads[0] != "Breaking:":
            yield f"{changelog}: {name} begins with `{heads[0]}`, and `Breaking:` comes first"


def main():
    root = pathlib.Path(sys.argv[1])
    pages = [root / "README.md", root / "CONTRIBUTING.md", *sorted((root / "docs").glob("*.md")), *(root / page for page in CONTRIBUTORS_PAGES)]
    problems = [problem for page in pages for problem in broken_links(page)]
    problems += [problem for page in [*pages, root / "CHANGELOG.md"] for problem in merge_marks(page)]
    problems += releases(root / "CHANGELOG.md")
    index = (root / "docs/README.md").read_text()
    problems += [f"docs/README.md does not name {page.name}" for page in pages[2:]
                 if page.name != "README.md" and f"({page.name})" not in index]
    lines = (root / "README.md").read_text().splitlines()
    problems += [f"README.md has {len(lines)} lines"] if len(lines) > MOST_LINES else []
    problems += [f"README.md:{number}: {len(line)} columns" for number, line in enumerate(lines, 1) if len(line) > MOST_COLUMNS]
    print("\n".join(problems) or f"{len(pages)} pages, no link leads nowhere")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
