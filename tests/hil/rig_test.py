#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the rig reads cases strictly, tells verdicts apart, and leaves no machine behind. Method: its own functions, with a
program that never ends in the place of qemu; the cases that exist must all have a complete header. Needs no guest.
"""
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest
from unittest import mock

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))
import hil
from rig import machine, package, saved
from rig.case import BadCase, Case, all_cases, matching, read_case, script_with_fault

HEADER = ("#!/bin/bash\n# Goal: g\n# Method: one\n#   two\n# Mode: virtual\n# Limit: 7 s\n# Planted fault: f\n"
          "# Planted by: s/^echo/false/\necho\n# Mode: paced\n")


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
                      HEADER.replace("7 s", "7 min"), HEADER.replace("# Limit", "# Machine: vax\n# Limit"),
                      HEADER.replace("# Limit", "# Limit: 8 s\n# Limit"), HEADER.replace("# Limit", "# Planted fault: another\n# Limit")):
            with self.assertRaises(BadCase):
                self.case(wrong)

    def test_every_case_is_readable_and_can_be_given_its_planted_fault(self) -> None:
        cases = [*all_cases(hil.HERE / "cases"), *all_cases(hil.HERE / "bench")]
        self.assertGreater(len(cases), 10)
        for case in cases:
            for run in hil.runs_of(case, planted=True):
                self.assertEqual(subprocess.run(["bash", "-n"], input=run.script, text=True, check=False).returncode, 0, run.name)

    def test_plants_faults_only_when_asked_and_each_by_itself(self) -> None:
        case = self.case(HEADER)
        self.assertEqual([(run.name, run.script) for run in hil.runs_of(case, planted=False)], [("one", HEADER)])
        self.assertEqual([(run.name, run.script) for run in hil.runs_of(case, planted=True)],
                         [("one", HEADER.replace("\necho", "\nfalse"))])
        two = HEADER.replace("# Limit", "# Planted fault: g\n# Planted by: s/^echo/true/\n# Limit")
        self.assertEqual([(run.name, run.script) for run in hil.runs_of(self.case(two), planted=True)],
                         [("one-1", two.replace("\necho", "\ntrue")), ("one-2", two.replace("\necho", "\nfalse"))])

    def test_refuses_a_fault_that_changes_nothing(self) -> None:
        for by in ("s/^nothing/false/", "s/unfinished"):
            with self.assertRaises(BadCase):
                script_with_fault(self.case(HEADER), by)

    def test_a_short_limit_comes_first(self) -> None:
        for name, limit in (("a", "9 s"), ("b", "10 s"), ("c", "9 s")):
            (self.folder / f"{name}.sh").write_text(HEADER.replace("7 s", limit))
        self.assertEqual([case.name for case in all_cases(self.folder)], ["a", "c", "b"])

    def test_filter_is_a_regular_expression(self) -> None:
        cases = [Case(name, self.folder, "", "", "virtual", "plain", 1) for name in ("bus_off", "link_down", "tracking")]
        self.assertEqual([case.name for case in matching(cases, "bus|link")], ["bus_off", "link_down"])
        self.assertEqual(len(matching(cases, None)), 3)


class Verdicts(Folder):
    def test_tells_verdicts_apart(self) -> None:
        (self.folder / "out").mkdir()
        for written, in_time, expected in ((None, True, "no verdict"), (None, False, "limit"), ("0", True, "passed"),
                                           ("1", True, "failed"), ("124", True, "limit"), ("", True, "no verdict")):
            verdict = self.folder / "out/verdict"
            verdict.unlink(missing_ok=True)
            if written is not None:
                verdict.write_text(written)
            self.assertEqual(hil.result_of(self.folder, in_time), expected)

    def takt_that_says_what_the_run_holds(self) -> pathlib.Path:
        takt = self.folder / "takt"
        takt.write_text("#!/bin/sh\ncat \"$3/says\"\n")
        takt.chmod(0o755)
        return takt

    def recorded(self, run: str, **findings: object) -> None:
        folder = self.folder / "out/runs" / run
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "ticks.mcap").touch()
        found = {"reproduces": True, "ticks": 7, "not_judged": 0, "missing": 0, "unrecorded": 0, "file_finished": True}
        (folder / "says").write_text(json.dumps(found | findings))

    def test_a_case_without_a_recorded_tick_has_not_passed(self) -> None:
        takt = self.takt_that_says_what_the_run_holds()
        case, silent = self.case(HEADER), self.case(HEADER.replace("# Limit", "# Runs: none\n# Limit"))
        self.assertIn("no run", hil.replay_failure(case, self.folder, takt))
        self.assertEqual(hil.replay_failure(silent, self.folder, takt), "")
        for run, ticks in (("a", 0), ("b", 7)):
            self.recorded(run, ticks=ticks)
            self.assertEqual(hil.replay_failure(case, self.folder, takt) == "", run == "b")

    def test_a_recording_cut_off_at_the_guests_end_is_judged_by_its_ticks(self) -> None:
        takt = self.takt_that_says_what_the_run_holds()
        for lacks, partly_lacks, findings in ((False, False, {"file_finished": False}), (True, False, {"not_judged": 1}),
                                              (True, True, {"missing": 1}), (True, True, {"unrecorded": 1}),
                                              (True, True, {"reproduces": False})):
            self.recorded("a", **findings)
            for header, expected in ((HEADER, lacks), (HEADER.replace("# Limit", "# Replay: partly\n# Limit"), partly_lacks)):
                self.assertEqual(hil.replay_failure(self.case(header), self.folder, takt) != "", expected, findings)

    def test_a_replay_that_ends_without_a_word_has_not_passed(self) -> None:
        self.recorded("a")
        self.assertIn("exit code 1", hil.replay_failure(self.case(HEADER), self.folder, pathlib.Path("/bin/false")))

    def test_tests_the_one_package_that_is_no_takt_dev(self) -> None:
        with self.assertRaises(package.BadPackage):
            package.package_in(self.folder)
        for name in ("takt_0.1.0-1_amd64.deb", "takt-dev_0.1.0-1_amd64.deb"):
            (self.folder / name).write_text("a package")
        self.assertEqual(package.package_in(self.folder).name, "takt_0.1.0-1_amd64.deb")
        (self.folder / "takt_0.2.0-1_amd64.deb").write_text("another")
        with self.assertRaises(package.BadPackage):
            package.package_in(self.folder)


class Machines(Folder):
    def run_instead_of_qemu(self, script: str, wall_limit_s: float) -> tuple[machine.Ending, list[str]]:
        lines: list[str] = []
        command = lambda case, image, job, out: [sys.executable, "-c", script, out]
        with mock.patch.object(machine, "qemu_command", command):
            ending = machine.run_machine(self.case(HEADER), self.folder, self.folder, wall_limit_s, lines.append)
        return ending, lines

    def test_ends_a_machine_that_does_not_end(self) -> None:
        marker = f"marker_{id(self)}"
        ending, _ = self.run_instead_of_qemu(f"import time  # {marker}\nwhile True: time.sleep(1)", 0.5)
        self.assertFalse(ending.in_time)
        self.assertEqual(subprocess.run(["pgrep", "-f", marker], capture_output=True, check=False).stdout, b"")

    def test_tells_the_processor_time(self) -> None:
        ending, _ = self.run_instead_of_qemu("import time\nwhile time.process_time() < 0.3: pass", 60)
        self.assertTrue(0.3 <= ending.cpu_s < 10, ending)

    def test_tells_a_waiting_guest_to_go_on(self) -> None:
        guest = ("import socket, sys\ns = socket.socket(socket.AF_UNIX)\ns.connect(sys.argv[1])\n"
                 "s.sendall(b'guest: started\\n')\ns.sendall(b'told to ' + s.recv(9))")
        self.assertEqual(self.run_instead_of_qemu(guest, 60)[1], ["guest: started", "told to go"])

    def test_streams_every_line(self) -> None:
        ending, lines = self.run_instead_of_qemu(
            "import socket, sys\ns = socket.socket(socket.AF_UNIX)\ns.connect(sys.argv[1])\ns.sendall(b'one\\r\\ntwo\\n')", 60)
        self.assertTrue(ending.in_time)
        self.assertEqual(lines, ["one", "two"])


class SavedMachines(Folder):
    """A script in qemu's place says what its guest says (first boot, then with the job), then does what the monitor is told:
    `migrate "exec:COMMAND"`, `quit`."""
    QEMU = ("import socket, subprocess, sys\n"
            "begin = [option for option in sys.argv if option.startswith('exec:cat ')]\n"
            "out, monitor = socket.socket(socket.AF_UNIX), socket.socket(socket.AF_UNIX)\n"
            "out.connect(sys.argv[1])\nmonitor.connect(sys.argv[-1].removeprefix('unix:'))\n"
            "if begin: assert out.recv(9) == b'go\\n'\n"
            "out.sendall(%r if begin else %r)\n"
            "if %r: out.shutdown(socket.SHUT_WR)\n"
            "for line in monitor.makefile():\n"
            "    if line == 'quit\\n': break\n"
            "    if line.startswith('migrate '): subprocess.run(line.split('exec:')[1].rstrip('\\n\"'), shell=True, input=b'%s')\n")

    def save(self, after_boot: bytes, after_job: bytes = b"guest: installed\n", ends: bool = False) -> pathlib.Path:
        case = self.case(HEADER)
        script_text = self.QEMU % (after_job, after_boot, ends, "all")
        command = lambda case, image, job, out: [sys.executable, "-c", script_text, out]
        with mock.patch.object(saved, "qemu_command", command), \
                mock.patch.object(saved, "_started", lambda case, image: image / "started-plain-1"):
            for age, old in enumerate(("started-plain-0", "installed-plain-0", "installed-plain-00", "started-kvaser-0")):
                (self.folder / old).touch()
                os.utime(self.folder / old, (1000 - age, 1000 - age))
            saved.save_if_missing(case, self.folder, lambda: self.folder, "package")
            return saved.installed(case, self.folder, "package")

    def test_saves_a_machine_that_waits_and_again_with_the_package(self) -> None:
        installed = self.save(b"guest: started\n")
        self.assertEqual((self.folder / "started-plain-1").read_text(), "all")
        self.assertEqual(installed.read_text(), "all")
        self.assertIn(f"exec:cat '{installed}'", saved.goes_on_from(installed))
        self.assertEqual(sorted(path.name for path in self.folder.glob("*-0*")), ["installed-plain-0", "started-kvaser-0"],
                         "another checkout's package stays; machines of another kind do too")

    def test_refuses_a_guest_that_ends_instead(self) -> None:
        with self.assertRaises(saved.NotSaved):
            self.save(b"hil: no root file system\n", ends=True)
        self.assertFalse((self.folder / "started-plain-1").exists())

    def test_rigs_of_two_checkouts_save_one_at_a_time(self) -> None:
        case = self.case(HEADER)
        with saved._only_one(case, self.folder):
            other = (f"import fcntl\nfcntl.flock(open({str(self.folder / 'lock-plain')!r}, 'w'), fcntl.LOCK_EX | fcntl.LOCK_NB)")
            self.assertNotEqual(subprocess.run([sys.executable, "-c", other], capture_output=True, check=False).returncode, 0)

    def test_tells_why_the_package_does_not_install(self) -> None:
        (self.folder / "started-plain-1").touch()
        with self.assertRaisesRegex(saved.NotInstalled, "libzstd1 is not installed"):
            self.save(b"", b"Takt does not install:\nlibzstd1 is not installed\n", ends=True)
        self.assertEqual(list(self.folder.glob("installed-*[!0]")), [])

    def test_another_package_is_another_machine(self) -> None:
        with mock.patch.object(saved, "_started", lambda case, image: image / "started-plain-1"):
            self.assertNotEqual(*(saved.installed(self.case(HEADER), self.folder, package_hash) for package_hash in ("a", "b")))

    def test_machines_at_real_pace_boot(self) -> None:
        self.assertFalse(saved.begins_saved(self.case(HEADER.replace("virtual", "paced", 1))))
        self.assertTrue(saved.begins_saved(self.case(HEADER)))


if __name__ == "__main__":
    unittest.main()
