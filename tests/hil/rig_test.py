#!/usr/bin/env python3
"""Goal: the rig reads cases strictly, tells verdicts apart, and leaves no machine behind. Method: its own functions, with a
program that never ends in the place of qemu; the cases that exist must all have a complete header. Needs no guest.
"""
import pathlib
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import hil
from rig import machine, payload
from rig.case import BadCase, Case, all_cases, matching, read_case

HEADER = "#!/bin/bash\n# Goal: g\n# Method: one\n#   two\n# Mode: virtual\n# Limit: 7 s\necho\n# Mode: paced\n"


class Folder(unittest.TestCase):
    def setUp(self) -> None:
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def case(self, text: str) -> Case:
        path = self.folder / "one.sh"
        path.write_text(text)
        return read_case(path)


class Headers(Folder):
    def test_reads_the_header_and_nothing_behind_it(self) -> None:
        case = self.case(HEADER)
        self.assertEqual((case.name, case.goal, case.mode, case.machine, case.limit_s), ("one", "g", "virtual", "plain", 7))

    def test_refuses_what_it_cannot_use(self) -> None:
        for wrong in (HEADER.replace("Mode: virtual", "Mode: fast"), HEADER.replace("# Goal", "# Gaol"),
                      HEADER.replace("7 s", "7 min"), HEADER.replace("# Limit", "# Machine: vax\n# Limit")):
            with self.assertRaises(BadCase):
                self.case(wrong)

    def test_every_case_is_readable_and_names_its_planted_fault(self) -> None:
        cases = all_cases(hil.HERE / "cases")
        self.assertGreater(len(cases), 10)
        for case in cases:
            self.assertIn("# Planted fault: ", case.path.read_text(), case.name)

    def test_filter_is_a_regular_expression(self) -> None:
        cases = [Case(name, self.folder, "", "virtual", "plain", 1) for name in ("bus_off", "link_down", "tracking")]
        self.assertEqual([case.name for case in matching(cases, "bus|link")], ["bus_off", "link_down"])
        self.assertEqual(len(matching(cases, None)), 3)


class Verdicts(Folder):
    def test_tells_verdicts_apart(self) -> None:
        case = self.case(HEADER)
        (self.folder / "out").mkdir()
        for written, in_time, expected in ((None, True, "no verdict"), (None, False, "limit"), ("0", True, "passed"),
                                           ("1", True, "failed"), ("124", True, "limit"), ("", True, "no verdict")):
            verdict = self.folder / "out/verdict"
            verdict.unlink(missing_ok=True)
            if written is not None:
                verdict.write_text(written)
            self.assertEqual(hil.verdict_of(case, self.folder, in_time, 1.0).result, expected)

    def test_takt_dev_is_no_part_of_the_payload(self) -> None:
        for name in ("takt_0.1.0-1_amd64.deb", "takt-dev_0.1.0-1_amd64.deb"):
            (self.folder / name).write_text("a package")
        payload.hand_over(self.folder, self.folder / "guest")
        self.assertEqual([path.name for path in (self.folder / "guest").iterdir()], ["takt_0.1.0-1_amd64.deb"])

    def test_a_payload_without_programs_is_refused(self) -> None:
        with self.assertRaises(payload.BadPayload):
            payload.required_packages(self.folder)


class Machines(Folder):
    def run_instead_of_qemu(self, script: str, wall_limit_s: float) -> tuple[bool, list[str]]:
        lines: list[str] = []
        command = lambda case, image, job, out: [sys.executable, "-c", script, out]
        with mock.patch.object(machine, "qemu_command", command):
            ended = machine.run_machine(self.case(HEADER), self.folder, self.folder, wall_limit_s, lines.append)
        return ended, lines

    def test_ends_a_machine_that_does_not_end(self) -> None:
        marker = f"marker_{id(self)}"
        ended, _ = self.run_instead_of_qemu(f"import time  # {marker}\nwhile True: time.sleep(1)", 0.5)
        self.assertFalse(ended)
        self.assertEqual(subprocess.run(["pgrep", "-f", marker], capture_output=True, check=False).stdout, b"")

    def test_streams_every_line(self) -> None:
        ended, lines = self.run_instead_of_qemu(
            "import socket, sys\ns = socket.socket(socket.AF_UNIX)\ns.connect(sys.argv[1])\ns.sendall(b'one\\r\\ntwo\\n')", 60)
        self.assertTrue(ended)
        self.assertEqual(lines, ["one", "two"])


if __name__ == "__main__":
    unittest.main()
