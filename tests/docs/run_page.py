#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Executes a page of the documentation: run_page.py [--patient] PAGE.md BIN_DIR [NAME=FILE...]

Blocks are taken in the page's order, in one new temporary folder that sees the repository's `config/` and `docs/`, the build's wheel
in `build/python`, and has BIN_DIR first in PATH:

    ```yaml lab.yaml      a block with a file name after its language is written to that file
    ```console            lines that begin with "$ " are commands for bash; "> " below one goes on with it

Lines below a command are what it prints, on stdout and stderr together: `...` stands for any text within a line, and
alone on a line for any number of lines; a number with a decimal point may be off by a tenth. Without such lines the output is not looked at, and how far
a command has come, which it says after half a minute, is no part of it. A command must exit with 0; one
that is meant to fail prints its code (`; echo "exit code $?"`). Other blocks are left alone.

--patient: the demo arm of the page's `config/` is patient with a machine that stalls, as the tests' robots are: what a page of a robot at real
pace shows is not how fast the machine is.

NAME=FILE: a file that the page's reader brings along, under that name.

Exit codes: 0 the page is true; 1 it is not, with page, line, command and what came out instead; 64 command line; 77 a file to bring along is absent (1 with TAKT_REQUIRE_SHARED=1).
"""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "process"))
from patient import patient  # noqa: E402

COMMAND_TIMEOUT_S = 240
TOLERANCE = 0.1  # of numbers with a decimal point: mathematical functions differ between processors
PROGRESS = re.compile(r"^\d+/\d+ [a-z ]+(?:, \d+:\d\d left)?(?:: .*)?\n", re.MULTILINE)
NUMBER = re.compile(r"(\d+\.\d+)")


def blocks(text):
    """(line number of the first line, language, file name or "", lines) of each fenced block."""
    start, indent, info, lines = 0, 0, None, []
    for number, line in enumerate(text.splitlines(), 1):
        fence = line.lstrip().startswith("```")
        if fence and info is None:
            info, start, lines = (line.strip()[3:].split() + ["", ""])[:2], number + 1, []
            indent = len(line) - len(line.lstrip())
        elif fence:
            yield start, info[0], info[1], lines
            info = None
        elif info is not None:
            lines.append(line[indent:])


def commands(start, lines):
    """(line number, command, expected lines) of a console block."""
    found = []
    for number, line in enumerate(lines, start):
        if line.startswith("$ "):
            found.append([number, line[2:], []])
        elif not found:
            raise ValueError(f"line {number}: a console block begins with a command, '$ ...'")
        elif line.startswith("> ") and not found[-1][2]:
            found[-1][1] += "\n" + line[2:]
        else:
            found[-1][2].append(line)
    return found


def pieces(line):
    """A line of the page, taken apart into `...`, numbers with a decimal point, and what lies between."""
    return re.split(r"(\.\.\.|\d+\.\d+)", line.rstrip())


def line_pattern(line):
    if line.strip() == "...":
        return r"(?:[^\n]*\n)*?"
    return "".join(".*?" if piece == "..." else NUMBER.pattern if NUMBER.fullmatch(piece) else re.escape(piece)
                   for piece in pieces(line)) + " *\n"


def agrees(output, expected):
    found = re.fullmatch("".join(map(line_pattern, expected)), output)
    said = [float(piece) for line in expected for piece in pieces(line) if NUMBER.fullmatch(piece)]
    return found is not None and all(abs(float(number) - wanted) <= TOLERANCE * wanted
                                     for number, wanted in zip(found.groups(), said, strict=True))


def problem(command, expected, folder, environment):
    """What is not as the page says; empty: nothing."""
    try:
        done = subprocess.run(["bash", "-c", command], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=COMMAND_TIMEOUT_S)
    except subprocess.TimeoutExpired:
        return f"did not end within {COMMAND_TIMEOUT_S} s"
    output = PROGRESS.sub("", done.stdout if done.stdout.endswith("\n") or not done.stdout else done.stdout + "\n")
    if done.returncode != 0:
        return f"exit code {done.returncode}; it printed\n{output}"
    if any(line.strip() for line in expected) and not agrees(output, expected):
        return f"it printed\n{output}where the page says\n" + "\n".join(expected)
    return ""


def run_page(page, folder, environment):
    count = 0
    for start, language, name, lines in blocks(page.read_text()):
        if name:
            (folder / name).write_text("\n".join(lines) + "\n")
        elif language == "console":
            for number, command, expected in commands(start, lines):
                count += 1
                wrong = problem(command, expected, folder, environment)
                if wrong:
                    return count, f"{page}:{number}: $ {command}\n{wrong}"
    return count, ""


def patient_config(config, folder):
    """All of config/ under that name in the folder, but for the demo arm, which waits longer for its drives, and they for it."""
    (folder / "config").mkdir()
    for entry in config.iterdir():
        (folder / "config" / entry.name).symlink_to(entry)
    arm = folder / "config/arm6.yaml"
    text = patient(arm.read_text())
    arm.unlink()
    arm.write_text(text)


def main():
    arguments = [argument for argument in sys.argv[1:] if argument != "--patient"]
    brought = dict(argument.split("=", 1) for argument in arguments[2:])
    if len(arguments) < 2:
        print(__doc__, file=sys.stderr)
        return 64
    page, programs = (pathlib.Path(argument).resolve() for argument in arguments[:2])
    absent = [file for file in brought.values() if not pathlib.Path(file).exists()]
    if absent:
        print(f"SKIPPED: {', '.join(absent)} IS ABSENT: THE COMMANDS OF {page.name} WERE NOT RUN")
        return 1 if os.environ.get("TAKT_REQUIRE_SHARED") == "1" else 77
    folder = pathlib.Path(tempfile.mkdtemp(prefix="takt-docs."))
    try:
        (folder / "docs").symlink_to(page.parent)
        (folder / "client").symlink_to(page.parent.parent / "client")
        for name, file in brought.items():
            shutil.copy(file, folder / name)
        if "--patient" in sys.argv:
            patient_config(page.parent.parent / "config", folder)
        else:
            (folder / "config").symlink_to(page.parent.parent / "config")
        (folder / "build").mkdir()
        (folder / "build/python").symlink_to(programs.parent / "python")
        # A robot of the page is of this page alone: two pages, or a page and a test, may run at once.
        # Of other programs Debian's come first: a page's Python is the one that Debian's packages are for.
        environment = dict(os.environ, PATH=f"{programs}:/usr/bin:{os.environ['PATH']}", LC_ALL="C.UTF-8", XDG_RUNTIME_DIR=str(folder))
        count, wrong = run_page(page, folder, environment)
    finally:
        shutil.rmtree(folder)
    if wrong:
        print(wrong, file=sys.stderr)
        return 1
    if count == 0:
        print(f"{page}: no command to run: is it still written in console blocks?", file=sys.stderr)
        return 1
    print(f"{page.name}: {count} commands did what the page says")
    return 0


if __name__ == "__main__":
    sys.exit(main())
