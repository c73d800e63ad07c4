# SPDX-License-Identifier: Apache-2.0
"""One test of the rig: a program in cases/ whose header says what it is.

Header lines, comments at the top of the file: `Goal:`, `Method:`, `Mode: virtual|paced` (one CPU in virtual time, or two
CPUs at real pace), `Limit: N s` of the guest's time, and, where the machine needs more than vcan, `Machine: kvaser`
or `Machine: watchdog`; further, once or more often, `Planted fault:`, in words, followed by `Planted by:`, the sed expression that
puts it into the case; `Runs: none` where no monitor records, `Replay: partly` where one comes late, so that
not every tick can be judged.
A line that begins with two more spaces goes on where the one above ended.
"""
from __future__ import annotations

import dataclasses
import pathlib
import re
import subprocess

MODES = ("virtual", "paced")
MACHINES = ("plain", "kvaser", "watchdog")
REQUIRED = ("Goal", "Method", "Planted fault", "Planted by")
REPEATED = ("Planted fault", "Planted by")
HEADER = re.compile(rf"# ({'|'.join(REQUIRED)}|Mode|Limit|Machine|Runs|Replay): (.*)")


class BadCase(Exception):
    """A case whose header the rig cannot use: one sentence."""


@dataclasses.dataclass(frozen=True)
class Case:
    name: str
    path: pathlib.Path
    goal: str
    planted_by: tuple[str, ...]
    mode: str
    machine: str
    limit_s: int
    records: bool = True  # at least one run, which the host replays
    replay: str = "whole"


def read_header(text: str) -> dict[str, list[str]]:
    fields: dict[str, list[str]] = {}
    last = None
    for line in text.splitlines():
        if not line.startswith("#"):
            break
        if match := HEADER.match(line):
            last = match[1]
            fields.setdefault(last, []).append(match[2].strip())
        elif last and line.startswith("#   "):
            fields[last][-1] += " " + line[1:].strip()
    return fields


def one_of(path: pathlib.Path, field: str, value: str | None, allowed: tuple[str, ...]) -> str:
    if value not in allowed:
        raise BadCase(f"{path}: `# {field}: {value}` should be one of {', '.join(allowed)}")
    return value


def read_case(path: pathlib.Path) -> Case:
    fields = read_header(path.read_text())
    if missing := [field for field in REQUIRED if field not in fields]:
        raise BadCase(f"{path}: its header lacks `# {missing[0]}:`")
    if len(fields["Planted fault"]) != len(fields["Planted by"]):
        raise BadCase(f"{path}: its header needs one `# Planted by:` for each `# Planted fault:`")
    if twice := [field for field, values in fields.items() if len(values) > 1 and field not in REPEATED]:
        raise BadCase(f"{path}: its header has `# {twice[0]}:` twice")
    header = {field: values[0] for field, values in fields.items()}
    limit = re.fullmatch(r"(\d+) s", header.get("Limit", "60 s"))
    if not limit:
        raise BadCase(f"{path}: `# Limit: {header['Limit']}` should read like `# Limit: 60 s`")
    return Case(path.stem, path, header["Goal"], tuple(fields["Planted by"]),
                one_of(path, "Mode", header.get("Mode"), MODES),
                one_of(path, "Machine", header.get("Machine", "plain"), MACHINES), int(limit[1]),
                one_of(path, "Runs", header.get("Runs", "some"), ("some", "none")) == "some",
                one_of(path, "Replay", header.get("Replay", "whole"), ("whole", "partly")))


def all_cases(folder: pathlib.Path) -> list[Case]:
    """Those with a short limit first, so that a first result comes soon."""
    cases = [read_case(path) for path in folder.glob("*.sh")]
    return sorted(cases, key=lambda case: (case.limit_s, case.name))


def matching(cases: list[Case], pattern: str | None) -> list[Case]:
    """Those whose name contains the pattern (a regular expression)."""
    return [case for case in cases if not pattern or re.search(pattern, case.name)]


def script(case: Case) -> str:
    """What the guest runs."""
    return case.path.read_text()


def script_with_fault(case: Case, planted_by: str) -> str:
    """The case with one of its planted faults."""
    text = script(case)
    changed = subprocess.run(["sed", "-e", planted_by], input=text, capture_output=True, text=True, check=False)
    if changed.returncode != 0 or changed.stdout == text:
        raise BadCase(f"{case.path}: `# Planted by: {planted_by}` changes nothing {changed.stderr.strip()}".rstrip())
    return changed.stdout
