# SPDX-License-Identifier: Apache-2.0
"""A copy of the checkout in which every mutant is asleep: one build holds them all, and TAKT_MUTANT wakes one (switch.hpp)."""
import hashlib
import json
import multiprocessing
import os
import pathlib
import re
import subprocess
import sys
import tomllib

import places

HERE = pathlib.Path(__file__).parent
SWITCH = '#include "tests/mutants/switch.hpp"\n#line 1\n'  # the lines of a copy are those of its original


def rewritten(source, edits):
    """The text with every edit; edits nest, or stand side by side."""
    marks = []  # (where, what comes first there, inner before outer or the other way round, text, where the source goes on)
    for order, edit in enumerate(edits):
        size = edit.end - edit.start
        marks.append((edit.end, 0, size, -order, edit.after, edit.end))
        if edit.cut:
            marks.append((edit.cut[0], 1, 0, 0, edit.cut[2], edit.cut[1]))
        marks.append((edit.start, 2, -size, order, edit.before, edit.start))
    out, at = [], 0
    for offset, _, _, _, text, goes_on in sorted(marks):
        out += [source[at:offset], text.encode()]
        at = goes_on
    return b"".join([*out, source[at:]])


def crosses(edit, start, end):
    inside = start <= edit.start and edit.end <= end
    around = edit.start <= start and end <= edit.end
    apart = edit.end <= start or end <= edit.start
    return not (inside or around or apart)


def add_fault(fault, source, found):
    """A hand-written mutant, as edit and mutant among those of its file. Says how to correct one that no longer applies."""
    at = []
    for function in found.functions:
        if function.name == fault["function"]:
            at += [match.start() for match in re.finditer(re.escape(fault["find"].encode()), source[function.start:function.end])]
            start = function.start
    if len(at) != 1:
        raise ValueError(f"faults.toml: `{fault['name']}`: {fault['find']!r} is {len(at)} times in {fault['function']} of {fault['file']}; "
                         "it must be there once: follow what the function says now")
    start += at[0]
    end = start + len(fault["find"].encode())
    line = source.count(b"\n", 0, start) + 1
    mutant = places.Mutant(fault["file"], line, fault["function"], "fault", fault["name"])
    if fault.get("is", "expression") == "expression":
        edit = places.Edit(start, end, f"(::takt_mutant::on(0x{mutant.id}U) ? ({fault['replace']}) : (", "))")
    else:
        edit = places.Edit(start, end, f"{{ if (::takt_mutant::on(0x{mutant.id}U)) {{ {fault['replace']} }} else {{ ", " } }")
    # Places that lie across the text are left out; those inside it stay.
    found.edits[:] = [edit] + [other for other in found.edits if not crosses(other, start, end)]
    found.mutants.append(mutant)


def without_lines(source, edits, lines):
    """Those edits that touch none of the lines."""
    if not lines:
        return edits

    def line_at(offset):
        return source.count(b"\n", 0, offset) + 1

    return [edit for edit in edits if lines.isdisjoint(range(line_at(edit.start), line_at(edit.end) + 1))]


def write_if_new(path, data):
    if path.exists() and path.read_bytes() == data:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(data)


class Tree:
    """build/mutants/tree beside the checkout `root`."""

    def __init__(self, root, scope):
        self.root, self.scope = pathlib.Path(root), scope
        self.folder = self.root / "build/mutants/tree"
        self.build = self.folder / "build/release"
        self.mutants = []
        outside = [one["file"] for one in scope["outside"] if "function" not in one]
        self.wanted = {name for name in self.files() if name.endswith((".cpp", ".hpp")) and name.startswith(tuple(scope["rooms"]))
                       and not any(re.fullmatch(pattern, name) for pattern in outside)}

    def files(self):
        names = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=self.root, check=True, capture_output=True, text=True).stdout.split("\n")
        return [name for name in names if name and (self.root / name).is_file()]

    def environment(self):
        return {**os.environ, "CCACHE_BASEDIR": str(self.folder), "CCACHE_NOHASHDIR": "true"}

    def configure(self):
        # The copy names the present sources, changed or not, before anything is rewritten.
        names = self.files()
        for name in names:
            if name not in self.wanted or not (self.folder / name).exists():
                write_if_new(self.folder / name, (self.root / name).read_bytes())
                (self.folder / name).chmod((self.root / name).stat().st_mode)
        kept = set(names)
        for folder, _, files in os.walk(self.folder):
            if os.path.relpath(folder, self.folder).split("/")[0] == "build":
                continue
            for file in files:
                if os.path.relpath(os.path.join(folder, file), self.folder) not in kept:
                    os.unlink(os.path.join(folder, file))
        done = subprocess.run(["cmake", "--preset", "release", "-DTAKT_BUILD_TESTS=ON", "-DTAKT_UNITY_BUILD=OFF"], cwd=self.folder, env=self.environment(), capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(done.stdout + done.stderr)

    def find(self):
        """{path: Places} of every wanted file; remembered until one of the sources or the finder changes."""
        digest = hashlib.sha256((HERE / "places.py").read_bytes() + repr(sorted(self.wanted)).encode())
        for name in self.files():
            if name.startswith(("executive/", "drivers/", "config/")) and name.endswith((".cpp", ".hpp")):
                digest.update(name.encode() + (self.root / name).read_bytes())
        memory = self.root / "build/mutants/places.json"
        if memory.exists():
            kept = json.loads(memory.read_text())
            if kept["digest"] == digest.hexdigest():
                return {name: read_places(one) for name, one in kept["places"].items()}
        units = [entry for entry in json.loads((self.build / "compile_commands.json").read_text())
                 if os.path.relpath(entry["file"], self.folder).startswith(tuple(self.scope["rooms"]))]
        found = {}
        with multiprocessing.Pool(os.cpu_count()) as pool:
            jobs = [(str(self.root), str(self.folder), unit, self.wanted) for unit in units]
            for one in pool.starmap(places.places_of_unit, jobs, chunksize=2):
                for name, there in one.items():
                    if name not in found or len(there.mutants) > len(found[name].mutants):
                        found[name] = there
        memory.write_text(json.dumps({"digest": digest.hexdigest(), "places": {name: written(one) for name, one in found.items()}}))
        return found

    def follow(self, names):
        """Of sources in which there is nothing to change: they may be others than last time."""
        for name in names:
            write_if_new(self.folder / name, (self.root / name).read_bytes())

    def rewrite(self, broken=()):
        """Writes the rewritten copies. `broken`: (file, line) whose edits do not compile and are left out."""
        faults = tomllib.loads((HERE / "faults.toml").read_text())["fault"]
        self.mutants = []
        everywhere = self.find()
        self.follow(self.wanted - everywhere.keys())
        for name, found in sorted(everywhere.items()):
            source = (self.root / name).read_bytes()
            for fault in faults:
                if fault["file"] == name:
                    add_fault(fault, source, found)
            text = rewritten(source, without_lines(source, found.edits, {line for file, line in broken if file == name}))
            self.mutants += [mutant for mutant in found.mutants if f"0x{mutant.id}U".encode() in text and not self.is_left_alone(mutant)]
            write_if_new(self.folder / name, SWITCH.encode() + text)
        for fault in faults:
            if not any(mutant.operator == "fault" and mutant.change == fault["name"] for mutant in self.mutants):
                raise ValueError(f"faults.toml: `{fault['name']}` is in no file that is mutated, or does not compile: {fault['file']}")
        ids = [mutant.id for mutant in self.mutants]
        if len(set(ids)) != len(ids):
            twice = [mutant.key for mutant in self.mutants if ids.count(mutant.id) > 1]
            raise ValueError(f"two mutants have one number: {twice}")

    def is_left_alone(self, mutant):
        return mutant.operator != "fault" and any(re.fullmatch(one["file"], mutant.file) and re.fullmatch(one["function"], mutant.function)
                                                  for one in self.scope["outside"] if "function" in one)

    def make(self, programs):
        """Builds the judges. What does not compile is left out, and said."""
        broken = set()
        for _ in range(4):
            self.rewrite(broken)
            done = subprocess.run(["nice", "cmake", "--build", "--preset", "release", "--target", *programs, "--", "-k", "0"], cwd=self.folder,
                                  env=self.environment(), capture_output=True, text=True)
            if done.returncode == 0:
                for file, line in sorted(broken):
                    print(f"left out, for it does not compile: {file}:{line}")
                return
            worse = {(os.path.relpath(os.path.realpath(self.build / file), self.folder), int(line)) for file, line in re.findall(r"^([^\s:]+):(\d+):\d+: error", done.stdout, re.M)}
            worse = {(file, line) for file, line in worse if file in self.wanted} - broken
            if not worse:
                sys.exit(done.stdout[-4000:])
            broken |= worse
        sys.exit(f"the mutated tree does not build: {sorted(broken)}\n{done.stdout[-4000:]}")


def written(found):
    return {"functions": [vars(one) for one in found.functions], "mutants": [vars(one) for one in found.mutants],
            "edits": [vars(one) for one in found.edits]}


def read_places(kept):
    return places.Places([places.Function(**one) for one in kept["functions"]], [places.Mutant(**one) for one in kept["mutants"]],
                         [places.Edit(**{**one, "cut": tuple(one["cut"])}) for one in kept["edits"]])
