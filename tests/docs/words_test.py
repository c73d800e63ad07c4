#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: pages say things in short sentences and in the trade's words (CONTRIBUTING.md, "Language").
Method: README.md, the other pages beside it and docs/*.md are read without code and what a command prints; tables are
read for single words only. No paragraph or list item has more than 90 words. No sentence has more than 45, and of a
page's sentences nine of ten have at most 30. No word of INSTEAD_OF is used. Each sentence begins on a line of its own,
of at most 120 columns. A span of code counts as one word. In the sources of the programs the strings are read for the
words of INSTEAD_OF: keys, help, messages. No sentence of a key's text has more than 25 words. Of all sources in C++,
C, Python, JavaScript, CMake, YAML, TOML, shell and systemd's units, tests included, comments and docstrings are read
for these words.
Usage: words_test.py REPOSITORY [PAGE...]. Exit codes: 0 fine, 1 not: a line per finding, with file, line and how to
correct it.
"""
import io
import math
import pathlib
import re
import subprocess
import sys
import tokenize

MOST_WORDS_OF_A_PARAGRAPH = 90
MOST_WORDS_OF_A_SENTENCE = 45
MOST_WORDS_OF_NINE_IN_TEN = 30
MOST_WORDS_OF_A_KEY = 25
MOST_COLUMNS = 120

# Pages that a command prints, whole or between two marks: they are corrected in that command's sources.
PRINTED_PAGES = {
    "docs/hazards.md": "build/release/bin/hazard_page",
    "docs/policies-tried.md": "./dev tried",
}
PRINTED_PARTS = {
    "docs/configuration.md": [(r"## Every key", r"## Starting from a deploy", "takt config keys")],
    "docs/drives.md": [(r"\| the simulated drive ", r"$", "simulated_drives_test, Cia402Profiles"),
                       (r"\| model \| velocity", r"$", "config/drives/make_presets.py")],
    "docs/panels.md": [(r"<!-- made by ", r"<!-- end of what it made", "tests/docs/headline_table.py --write")],
}
ROOMS = ("executive", "config", "dds", "drivers", "commissioning", "policy_host", "client", "sensors", "monitor", "simulation", "evidence", "lab", "systemd", "cli")
RECORDED = {"monitor/record/tick_schema.cpp"}  # its words are in every run folder

# Ends of the names of sources; the second's comments begin with #.
WITH_HASH = ("CMakeLists.txt", ".cmake", ".yaml", ".sh", ".toml", ".service", ".timer", ".target", "dev", ".ci/run")
COMMENTED = (".cpp", ".hpp", ".h", ".py", ".mjs", ".js", *WITH_HASH)
# Of C++, C and JavaScript: a comment, or a string in which no comment begins. The ' of 1'000 begins none.
COMMENT_OR_STRING = re.compile(r"""//[^\n]*|/\*(?:.|\n)*?\*/
                                   |R"([^()\\ ]{0,16})\((?:.|\n)*?\)\1"|"(?:[^"\\\n]|\\.)*"
                                   |(?<![0-9A-Fa-f])'(?:[^'\\\n]|\\.)+'|`(?:[^`\\]|\\.)*`""", re.VERBOSE)

# A release has at most 40 lines (pages_test.py): its lines are long and hold several sentences.
LONG_LINES = {"CHANGELOG.md"}

INSTEAD_OF = {
    r"nobody": "name the process or part, or say what does not happen",
    r"somebody|someone": "name the process, part or role (operator, user)",
    r"anybody|anyone": "name the process, part or role (any user, any process)",
    r"whoever": "name the process, part or role",
    r"no number": "NaN",
    r"mends?|mended|mending": "correct",
    r"betrayals?|betrays?": "wrong protocol IDs; shows",
    r"confess\w*": "report",
    r"led to a posture": "driven to a posture",
    r"(was|were|is|are) let go": "released",
    r"the last word of": "the last answer of",
    r"a person's wish": "operator input",
    r"(talks?|says?|speaks?) nonsense": "sends invalid commands",
    r"need not stop by (itself|themselves)": "has no command timeout",
    r"back in charge": "switch back to the configured policy",
}


CONTRIBUTORS_PAGES = ("drivers/protocol/README.md", "tests/mutants/README.md")


def printed_lines(name, lines):
    """Line numbers, from 0, of what commands printed into the page."""
    found = set()
    for begin, end, command in PRINTED_PARTS.get(name, []):
        first = next((number for number, line in enumerate(lines) if re.match(begin, line)), None)
        if first is None:
            sys.exit(f"{name}: what `{command}` prints is not found there: correct PRINTED_PARTS")
        last = next((number for number, line in enumerate(lines) if number > first and re.match(end, line)), None)
        if last is None:
            sys.exit(f"{name}: the end of what `{command}` prints is not found there: correct PRINTED_PARTS")
        found |= set(range(first, last + 1))
    return found


def prose(name, text):
    """(line number, line) of what is written by hand, tables included, "" for code."""
    lines = text.splitlines()
    skipped = printed_lines(name, lines)
    code, before = False, ""
    for number, line in enumerate(lines):
        fence = line.lstrip().startswith("```")
        code = code != fence
        indented = line.startswith("    ") and not before.strip()  # code by indentation
        before = before if indented else line
        yield number + 1, "" if fence or code or indented or number in skipped else line


def without_tables(lines):
    """The same with "" for rows, headings, comments and pictures: there a paragraph ends."""
    return [(number, "" if re.match(r"\s*(\||#|<!--|!\[)", line) else line) for number, line in lines]


def paragraphs(lines):
    """(line number of the first line, [(line number, text)]) of each paragraph and list item."""
    found = []
    for number, line in lines:
        item = re.match(r"\s*([-*]|\d+\.) +", line)
        if found and (not line.strip() or item):
            yield found
            found = []
        if line.strip():
            found.append((number, line[item.end():] if item else line))
    if found:
        yield found


def plain(text):
    """Without marks: a span of code is one word, a link is its text."""
    text = re.sub(r"``.+?``|`[^`]*`", "CODE", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    return re.sub(r"<[^>]*>|[*_|]", "", text)


def words(text):
    return [word for word in text.split() if re.search(r"\w", word)]


def sentences(paragraph):
    """(line number, words) of each sentence: it ends at . ! or ? before a capital, a digit, code or a line's end."""
    marked = " ".join(f"\x01{number}\x02 {line}" for number, line in paragraph)
    marked = re.sub(r"\b(e\.g|i\.e|cf|vs|No)\.", r"\1", plain(marked))
    number = paragraph[0][0]
    for sentence in re.split(r"(?<=[.!?])[\")]*\s+(?=\x01|[\"(]*[A-Z0-9])", marked):
        marks = re.findall(r"\x01(\d+)\x02", sentence)
        if re.match(r"\s*\x01", sentence):
            number = int(marks[0])
        count = len(words(re.sub(r"\x01\d+\x02", "", sentence)))
        if count:
            yield number, count
        number = int(marks[-1]) if marks else number


def too_long(name, found):
    lengths = []
    for paragraph in found:
        counted = list(sentences(paragraph))
        total = sum(count for _, count in counted)
        if total > MOST_WORDS_OF_A_PARAGRAPH:
            yield (f"{name}:{paragraph[0][0]}: a paragraph of {total} words, at most {MOST_WORDS_OF_A_PARAGRAPH}: "
                   "split it, or make a list of it")
        for number, count in counted:
            if count > MOST_WORDS_OF_A_SENTENCE:
                yield f"{name}:{number}: a sentence of {count} words, at most {MOST_WORDS_OF_A_SENTENCE}: split it"
        lengths += counted
    longest = sorted((count for _, count in lengths), reverse=True)
    allowed = len(longest) - math.ceil(0.9 * len(longest))
    if longest and longest[allowed] > MOST_WORDS_OF_NINE_IN_TEN:
        for number, count in lengths:
            if count > MOST_WORDS_OF_NINE_IN_TEN:
                yield (f"{name}:{number}: a sentence of {count} words on a page where more than one in ten has over "
                       f"{MOST_WORDS_OF_NINE_IN_TEN}: split it")


def unused_words(name, lines):
    for number, line in lines:
        for pattern, better in INSTEAD_OF.items():
            for found in re.finditer(rf"\b(?:{pattern})\b", plain(line), re.IGNORECASE):
                yield f"{name}:{number}: `{found.group()}` is not used: {better}"


def lines_of_more(name, lines):
    if name in LONG_LINES:
        return
    for number, line in lines:
        if len(line) > MOST_COLUMNS and " " in line.strip()[:MOST_COLUMNS]:
            yield f"{name}:{number}: {len(line)} columns, at most {MOST_COLUMNS}: begin a line at a sentence or a part of it"
        if len(list(sentences([(number, re.sub(r"^\s*\d+\. ", "", line))]))) > 1:
            yield f"{name}:{number}: two sentences on a line: begin each on a line of its own"


def findings(root, page):
    name = page.relative_to(root).as_posix()
    if name in PRINTED_PAGES:
        return []
    lines = list(prose(name, page.read_text()))
    sentences_only = without_tables(lines)
    return [*too_long(name, list(paragraphs(sentences_only))), *unused_words(name, lines), *lines_of_more(name, sentences_only)]


def strings(path):
    """(line number, string) of each string of a C++ file."""
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if re.match(r"\s*(//|#include)", line):
            continue
        for found in re.finditer(r'"((?:[^"\\]|\\.)*)"', re.sub(r"\s//[^\"]*$", "", line)):
            yield number, found[1]


def findings_in_sources(root):
    for path in sorted(path for room in ROOMS for path in (root / room).rglob("*.[ch]pp")):
        name = path.relative_to(root).as_posix()
        if name not in RECORDED:
            yield from unused_words(name, strings(path))


def comments(path):
    """(line number, text) of each comment and docstring of a source; one text may have several lines."""
    text = path.read_text()
    if path.suffix == ".py":
        begins = True  # a statement, and a string that is one by itself is a docstring
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT or begins and token.type == tokenize.STRING:
                yield token.start[0], token.string
            if token.type not in (tokenize.COMMENT, tokenize.NL):
                begins = token.type in (tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT)
    elif path.as_posix().endswith(WITH_HASH):
        for found in re.finditer(r"(?<!\S)#.*", text):
            yield text.count("\n", 0, found.start()) + 1, found[0]
    else:
        for found in COMMENT_OR_STRING.finditer(text):
            if found[0].startswith(("//", "/*")):
                yield text.count("\n", 0, found.start()) + 1, found[0]


def sources(root):
    """Those that git knows; without git those that are there."""
    listed = subprocess.run(["git", "-C", str(root), "ls-files"], capture_output=True, text=True)
    paths = listed.stdout.splitlines() or [path.relative_to(root).as_posix() for path in root.rglob("*")]
    others = {"build", "node_modules", "releases"}  # what an earlier release wrote stays as it is
    named = (path for path in paths if path.endswith(COMMENTED) and not others & set(path.split("/")))
    return sorted(path for path in named if (root / path).is_file())


def findings_in_comments(root):
    for name in sources(root):
        if name not in RECORDED:
            for number, text in comments(root / name):
                yield from unused_words(name, enumerate(text.split("\n"), number))


def long_keys(root):
    """Of the table that `takt config keys` prints: a semicolon ends a sentence there."""
    for number, line in enumerate((root / "docs/configuration.md").read_text().splitlines(), 1):
        row = re.match(r"\| `([^`]+)` \|.*\| ([^|]+) \|$", line)
        for part in re.split(r"(?<=[.;]) ", row[2] if row else ""):
            if len(words(plain(part))) > MOST_WORDS_OF_A_KEY:
                yield f"docs/configuration.md:{number}: {row[1]} has a sentence of {len(words(plain(part)))} words, at most {MOST_WORDS_OF_A_KEY}: split it"


def main():
    root = pathlib.Path(sys.argv[1])
    pages = [root / page for page in sys.argv[2:]] or [*sorted(root.glob("*.md")), *sorted((root / "docs").glob("*.md")),
                                                            *(root / page for page in CONTRIBUTORS_PAGES)]
    found = [finding for page in pages for finding in findings(root, page)]
    if not sys.argv[2:]:
        found += [*findings_in_sources(root), *findings_in_comments(root), *long_keys(root)]
    print("\n".join(found) or f"{len(pages)} pages in short sentences and plain words")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
