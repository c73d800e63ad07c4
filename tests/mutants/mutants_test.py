#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a mutant changes what it says and nothing else, asleep it changes nothing, and what judges say is understood.
Method: a small source with one of everything is rewritten, compiled once, and run with each mutant awake; edits that nest or
stand side by side are laid on a text; programs' ends are read. Exit code 77: python3-clang-19 is not installed.
"""
import os
import pathlib
import subprocess
import sys
import tempfile
import threading
import unittest

try:
    import clang.cindex  # noqa: F401
except ImportError:
    sys.exit(77)

HERE = pathlib.Path(__file__).resolve().parent
TOP = HERE.parent.parent
sys.dont_write_bytecode = True
sys.path.insert(0, str(HERE))

import judges  # noqa: E402
import mutants  # noqa: E402
import places  # noqa: E402
import schemata  # noqa: E402

SAMPLE = "tests/mutants/sample.cpp"
ORIGINAL = "5 0 5 2"


class Sample(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        entry = {"file": str(TOP / SAMPLE), "command": f"c++ -I{TOP} -std=c++23 -c {SAMPLE}"}
        cls.found = places.places_of_unit(str(TOP), str(TOP), entry, {SAMPLE})[SAMPLE]
        source = (TOP / SAMPLE).read_bytes()
        cls.fault = {"name": "pushed twice", "file": SAMPLE, "function": "main", "find": "joint.push(5);", "replace": "joint.push(10);", "is": "statements"}
        schemata.add_fault(cls.fault, source, cls.found)
        rewritten = pathlib.Path(cls.folder.name, "sample.cpp")
        rewritten.write_bytes(schemata.SWITCH.encode() + schemata.rewritten(source, cls.found.edits))
        cls.program = pathlib.Path(cls.folder.name, "sample")
        subprocess.run(["c++", "-std=c++23", "-Wall", "-Wextra", "-Wconversion", "-Werror", f"-I{TOP}", rewritten, "-o", cls.program], check=True)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def said(self, mutant="", record=None):
        environment = {**os.environ, "TAKT_MUTANT": mutant}
        if record:
            environment["TAKT_MUTANTS_REACHED"] = record
        return subprocess.run([self.program], env=environment, check=True, capture_output=True, text=True).stdout.strip()

    def of(self, operator, change):
        fit = [one for one in self.found.mutants if one.operator == operator and one.change == change]
        self.assertEqual(len(fit), 1, [f"{one.operator}: {one.change}" for one in self.found.mutants])
        return fit[0].id

    def test_asleep_it_is_the_original(self):
        self.assertEqual(self.said(), ORIGINAL)
        self.assertEqual(self.said("deadbeef"), ORIGINAL)

    def test_each_does_what_it_says(self):
        for operator, change, said in (
                ("relational", "age > most => >=", "5 1 5 2"),
                ("relational", "i < values.size() => all but the last", "5 0 1 2"),
                ("relational", "values[i] != 2 => ==", "5 0 2 2"),
                ("negate", "values[i] < 7", "5 0 0 2"),
                ("delete", "joint.push(5);", "0 0 5 2"),
                ("delete", "torque += by;", "0 0 5 2"),
                ("constant", "joint.push(5);: 5 - 1", "4 0 5 2"),
                ("constant", "return 1 + 1;: 1 + 1 #2", "5 0 5 3"),
                ("fault", "pushed twice", "10 0 5 2")):
            with self.subTest(change):
                self.assertEqual(self.said(self.of(operator, change)), said)

    def test_what_has_to_be_constant_is_left_alone(self):
        changes = " ".join(one.change for one in self.found.mutants)
        for untouched in ("kTable = 3", "case 4", "array<int, 3>", "static_assert"):
            self.assertNotIn(untouched, changes)

    def test_who_is_reached_is_recorded(self):
        with tempfile.NamedTemporaryFile() as record:
            self.said(record=record.name)
            reached = set(pathlib.Path(record.name).read_text().split())
        self.assertIn(self.of("delete", "joint.push(5);"), reached)
        self.assertNotIn(self.of("constant", "return 0;: 0 + 1"), reached)

    def test_numbers_do_not_depend_on_lines(self):
        moved = places.Mutant(SAMPLE, 999, *[getattr(self.found.mutants[0], name) for name in ("function", "operator", "change")])
        self.assertEqual(moved.id, self.found.mutants[0].id)
        self.assertEqual(len({one.id for one in self.found.mutants}), len(self.found.mutants))

    def test_a_fault_that_no_longer_applies_is_named(self):
        for change in ({"find": "joint.pull(5);"}, {"find": "{"}, {"function": "gone"}):
            with self.assertRaisesRegex(ValueError, "`pushed twice`.*must be there once"):
                schemata.add_fault({**self.fault, **change}, (TOP / SAMPLE).read_bytes(), self.found)


class Judging(unittest.TestCase):
    def test_edits_nest_and_stand_side_by_side(self):
        edits = [places.Edit(0, 5, "L(", ")", (1, 4, ", ")), places.Edit(0, 1, "x", "y"), places.Edit(4, 5, "x", "y"), places.Edit(5, 6, "<", ">")]
        self.assertEqual(schemata.rewritten(b"a < b;", edits), b"L(xay, xby)<;>")

    def test_the_end_of_a_program_is_understood(self):
        failed = "[ RUN      ] A.B\ncommand_age: elbow at 1.2000 s, tracking, written\n[  FAILED  ] A.B (3 ms)\n"
        self.assertEqual(judges.outcome_of(1, failed), judges.Outcome(True, ["A.B"], ["command_age"]))
        self.assertEqual(judges.outcome_of(-11, "[ RUN      ] A.B\n[ RUN      ] A.C\n"), judges.Outcome(True, ["A.C"], [], "crash"))
        self.assertEqual(judges.outcome_of(-9, "").how, "time")
        self.assertFalse(judges.outcome_of(0, failed).killed)

    def test_who_sleeps_for_ever_is_ended_and_who_works_is_not(self):
        for words, code in ((["sleep", "1000"], -9), (["sh", "-c", "i=0; while [ $i -lt 20000 ]; do i=$((i+1)); done"], 0)):
            child, ended = subprocess.Popen(words), threading.Event()
            watcher = threading.Thread(target=judges.end_who_sleeps, args=(child, ended, 0.5 if code else 60))
            watcher.start()
            os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
            ended.set()
            watcher.join()
            self.assertEqual(child.wait(), code)

    def test_survivors_count_unless_explained_and_stale_explanations_are_refused(self):
        one = places.Mutant("a.cpp", 1, "f", "negate", "x")
        other = places.Mutant("a.cpp", 2, "g", "delete", "y;")
        entry = {"file": "a.cpp", "function": "f", "kind": "equivalent", "why": "x is always so"}
        explained = mutants.Explained([entry], [one, other])
        self.assertTrue(explained.excuses(one))
        self.assertFalse(explained.excuses(other))
        with self.assertRaisesRegex(ValueError, "no such mutant any more"):
            mutants.Explained([{**entry, "function": "gone"}], [one])

    def test_a_header_without_places_follows_the_checkout(self):
        with tempfile.TemporaryDirectory() as folder:
            subprocess.run(["git", "init", "-q", folder], check=True)
            header = pathlib.Path(folder, "executive/a.hpp")
            header.parent.mkdir()
            header.write_text("struct A { int now; };")
            tree = schemata.Tree(folder, {"rooms": ["executive/"], "outside": []})
            schemata.write_if_new(tree.folder / "executive/a.hpp", b"struct A { int before; };")
            tree.find = lambda: {}
            with self.assertRaisesRegex(ValueError, "faults.toml"):  # whose files this checkout lacks
                tree.rewrite()
            self.assertEqual((tree.folder / "executive/a.hpp").read_text(), header.read_text())

    def test_a_surviving_fault_fails(self):
        explained = mutants.Explained([], [])
        killed = {"t": judges.Outcome(True, ["A.B"], [])}
        fault = places.Mutant("a.cpp", 1, "f", "fault", "x")
        self.assertEqual(mutants.sum_up([(fault, killed)], explained, True), 0)
        self.assertEqual(mutants.sum_up([(fault, {})], explained, True), 1)


if __name__ == "__main__":
    unittest.main()
