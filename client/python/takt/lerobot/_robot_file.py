# SPDX-License-Identifier: Apache-2.0
"""The robot file with another policy: its `policy` is replaced, and sensors that it lacks are added. Everything else stays, letter by letter."""
import json
import pathlib
import re
from dataclasses import dataclass, field
from typing import List, Tuple

from takt import _files
from takt._refused import Refused
from takt.lerobot._units import Joint

_LARGEST = 4 << 20  # bytes


def _text(value: str) -> str:
    return value if re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", value) else json.dumps(value)


def _list(values: List[str]) -> str:
    return "[" + ", ".join(values) + "]"


@dataclass
class Term:
    """`sensor`: of another term than the joints' positions. `image`: (height, width), RGB; None: `values` numbers."""

    tensor: str
    sensor: str = ""
    image: Tuple[int, int] = (0, 0)
    values: int = 0
    history: int = 1


@dataclass
class PolicySection:
    file: str
    period: str
    step_period: str
    steps: int
    output: str
    joints: List[Joint]
    terms: List[Term] = field(default_factory=list)
    join: str = "kind: replace"
    sampler: str = ""
    scale: str = "1"
    offset: str = "zero"

    def text(self) -> str:
        inputs = ",".join(one.tensor for one in self.terms)
        names = _list([_text(one.name) for one in self.joints])
        lines = ["policy:", f"  file: {_text(self.file) if ' ' in self.file else self.file}", f"  period: {self.period}", f"  step_period: {self.step_period}",
                 f"  steps: {self.steps}", f"  input: {json.dumps(inputs)}", f"  output: {self.output}", "  observation:"]
        for one in self.terms:
            what = f"term: sensor, sensor: {_text(one.sensor)}" if one.sensor else f"term: joint_position, joints: {names}"
            lines.append("    - { " + what + (f", history: {one.history}" if one.history > 1 else "") + " }")
        lines += ["  action:", "    kind: joint_position", f"    joints: {names}", f"    scale: {self.scale}", f"    offset: {self.offset}", "    interpolation: hold",
                  f"    join: {{ {self.join} }}"]
        return "\n".join(lines + ([f"  sampler: {{ {self.sampler} }}"] if self.sampler else [])) + "\n"


def _block(text: str, key: str) -> Tuple[int, int]:
    """Where a top-level key stands, to where the next one begins; equal: nowhere. Comments before the next one are the next one's."""
    found = re.search(rf"^{key}[ \t]*:", text, re.MULTILINE)
    if not found:
        return len(text), len(text)
    following = re.search(r"^[^\s#-]", text[found.end():], re.MULTILINE)
    end = found.end() + following.start() if following else len(text)
    lines = text[found.start():end].splitlines(keepends=True)
    while len(lines) > 1 and (not lines[-1].strip() or lines[-1].startswith("#")):
        lines.pop()
    return found.start(), found.start() + sum(map(len, lines))


def with_policy(path: pathlib.Path, section: PolicySection, timeout: str) -> Tuple[str, List[str]]:
    """The new text, and the sensors that were added to it."""
    text = _files.text_of(path)
    if len(text) > _LARGEST or not re.search(r"^schema[ \t]*:[ \t]*takt\.robot/", text, re.MULTILINE):
        raise Refused(f"{path} is not a robot file: it has no `schema: takt.robot/1`")
    begin, end = _block(text, "policy")
    text = text[:begin] + ("" if text[:begin].endswith("\n") else "\n") + section.text() + text[end:]
    begin, end = _block(text, "sensors")
    body = text[begin:end].partition(":")[2]
    if body.strip().startswith(("[", "{")) and body.strip() != "[]":
        raise Refused(f"{path}: `sensors` is written in brackets; write a line `- {{ name: ... }}` for each sensor")
    entries, added = [], []
    for term in section.terms:
        if term.sensor and not re.search(rf"\bname[ \t]*:[ \t]*(?:{re.escape(term.sensor)}|{re.escape(json.dumps(term.sensor))})[ \t]*[,}}\n#]", body):
            shape = f"image: {{ height: {term.image[0]}, width: {term.image[1]}, channels: 3 }}" if term.image[0] else f"values: {term.values}"
            entries.append(f"- {{ name: {_text(term.sensor)}, {shape}, timeout: {timeout} }}\n")
            added.append(term.sensor)
    if entries:
        dash = re.search(r"^( *)- ", body, re.MULTILINE)
        kept = "" if body.strip() == "[]" else body.rstrip("\n")
        text = text[:begin] + "sensors:" + kept + "\n" + "".join((dash[1] if dash else "  ") + one for one in entries) + text[end:]
    return text, added
