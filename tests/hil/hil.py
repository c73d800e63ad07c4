#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs Takt in an emulated robot PC: Debian's PREEMPT_RT kernel, systemd as PID 1, CAN interfaces.

  hil.py --package FOLDER [--jobs N] [--wall-limit S] [FILTER]   FOLDER with a takt_*.deb; FILTER: regular expression on the cases' names
  hil.py --package FOLDER --planted [FILTER]   each case with each of its planted faults: it must fail
  hil.py --package FOLDER --native             what needs no guest, on this machine's own vcan
  hil.py --list [FILTER]

Each case gets a fresh guest. Its output streams, with the case's name in front; journal, kernel log and run folders lie
in --out afterwards (default build/hil), beside summary.json. Page: docs/hil.md.
Exit codes: 0 every case passed (or every planted fault was found), 1 a case failed, 64 command line or a case's header,
69 something is missing on this machine (qemu, or vcan for --native) or the guest cannot be built, 130 interrupted.
"""
from __future__ import annotations

import argparse
import concurrent.futures
import dataclasses
import json
import os
import pathlib
import shutil
import subprocess
import sys
import time

from rig.case import BadCase, Case, all_cases, matching, script, script_with_fault
from rig.machine import QEMU, run_machine
from rig.package import BadPackage, hand_over, hash_of, package_in, programs_of, required_packages
from rig.saved import NotInstalled, NotSaved, begins_saved, goes_on_from, installed, save_if_missing

HERE = pathlib.Path(__file__).resolve().parent
TOP = HERE.parent.parent
EXIT_FAILED, EXIT_USAGE, EXIT_UNAVAILABLE, EXIT_INTERRUPTED = 1, 64, 69, 130


@dataclasses.dataclass(frozen=True)
class Run:
    name: str  # of the case; with one of several planted faults, its number behind
    case: Case
    script: str


@dataclasses.dataclass(frozen=True)
class Verdict:
    case: str
    mode: str
    result: str  # passed | failed | limit | no verdict; with its planted fault: found | missed | no verdict
    wall_s: float
    cpu_s: float  # of qemu


def runs_of(case: Case, planted: bool) -> list[Run]:
    if not planted:
        return [Run(case.name, case, script(case))]
    faults = case.planted_by
    return [Run(case.name if len(faults) == 1 else f"{case.name}-{number}", case, script_with_fault(case, by))
            for number, by in enumerate(faults, 1)]


def cache_folder() -> pathlib.Path:
    return pathlib.Path(os.environ.get("TAKT_HIL_CACHE") or pathlib.Path.home() / ".cache/takt/hil")


def build_guest(package: pathlib.Path) -> pathlib.Path:
    command = [*([] if os.geteuid() == 0 else ["sudo"]), str(HERE / "guest/build.sh"), str(cache_folder()),
               *required_packages(package)]
    built = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=False)
    if built.returncode != 0:
        raise BadPackage("the guest cannot be built (what failed stands above)")
    return pathlib.Path(built.stdout.strip().splitlines()[-1])


def empty_job(name: str, options: argparse.Namespace) -> pathlib.Path:
    job = options.out / name
    shutil.rmtree(job, ignore_errors=True)
    job.mkdir(parents=True)
    return job


def installation_job(case: Case, options: argparse.Namespace) -> pathlib.Path:
    job = empty_job(f"installation-{case.machine}", options)
    hand_over(options.package, job)
    (job / "environment").write_text("")
    return job


def case_job(run: Run, options: argparse.Namespace) -> pathlib.Path:
    case = run.case
    job = empty_job(run.name, options)
    if not begins_saved(case):
        hand_over(options.package, job)
    shutil.copytree(HERE / "lib", job / "lib")
    robots = job / "lib/robots"
    robots.mkdir()
    for source in [*TOP.glob("config/*.yaml"), *TOP.glob("config/*.onnx")]:
        shutil.copy(source, robots)
    (job / "lib/tools").mkdir()
    for tool in options.tool:
        subprocess.run(["strip", "-s", "-o", str(job / "lib/tools" / tool.name), str(tool)], check=True)
    (job / "case").write_text(run.script)
    (job / "case").chmod(0o755)
    (job / "environment").write_text(f"HIL_MODE={case.mode}\nHIL_LIMIT_S={case.limit_s}\n")
    return job


def result_of(job: pathlib.Path, in_time: bool) -> str:
    try:
        code = int((job / "out/verdict").read_text())
    except (FileNotFoundError, ValueError):
        return "no verdict" if in_time else "limit"
    return {0: "passed", 124: "limit"}.get(code, "failed")


def replay_failure(case: Case, job: pathlib.Path, takt: pathlib.Path) -> str:
    """What this machine's takt finds in the runs that the guest recorded; empty: every tick reproduces, bit for bit. A monitor
    that was killed at once leaves a run without a tick; another run then has some."""
    replayed = 0
    for run in sorted((job / "out/runs").glob("*/ticks.mcap")):
        replay = subprocess.run([str(takt), "replay", "--json", str(run.parent)], check=False, capture_output=True, text=True)
        try:
            found = json.loads(replay.stdout)
        except ValueError:
            return f"takt replay {run.parent}: exit code {replay.returncode}, {(replay.stdout + replay.stderr).strip()}"
        if found["ticks"] == 0:
            continue
        # The guest is switched off beneath its recorder, so that the file need not be closed. A case whose monitor comes late
        # has ticks before the first keyframe that it finds.
        unjudged = 0 if case.replay == "partly" else found["not_judged"]
        if not found["reproduces"] or found["missing"] or found["unrecorded"] or unjudged:
            return f"takt replay {run.parent}: exit code {replay.returncode}, {replay.stdout.strip()}"
        replayed += 1
    return "no run with a tick was recorded" if case.records and replayed == 0 else ""


def judge_failure(run: Run, job: pathlib.Path) -> str:
    """What CASE.py beside CASE.sh finds in what the guest left; its figures are printed. Empty: there is none, or all is well."""
    judge = run.case.path.with_suffix(".py")
    if not judge.exists():
        return ""
    judged = subprocess.run([str(judge), str(job / "out")], check=False, capture_output=True, text=True)
    print(f"{run.name:18} | {judged.stdout.strip()}", flush=True)
    return "" if judged.returncode == 0 else judged.stderr.strip() or f"{judge}: exit code {judged.returncode}"


def run_case(run: Run, image: pathlib.Path, options: argparse.Namespace) -> Verdict:
    case = run.case
    job = case_job(run, options)
    start = []
    if begins_saved(case):
        package_hash = hash_of(options.package)
        save_if_missing(case, image, lambda: installation_job(case, options), package_hash)
        start = goes_on_from(installed(case, image, package_hash))
    began = time.monotonic()
    ending = run_machine(case, image, job, options.wall_limit, lambda line: print(f"{run.name:18} | {line}", flush=True), start)
    result = result_of(job, ending.in_time)
    if result == "passed" and (failure := judge_failure(run, job)):
        print(f"{run.name:18} | {failure}", flush=True)
        result = "failed"
    if options.planted:
        result = {"passed": "missed", "failed": "found", "limit": "found"}.get(result, result)
    verdict = Verdict(run.name, case.mode, result, round(time.monotonic() - began, 1), round(ending.cpu_s, 1))
    if verdict.result == "passed" and (failure := replay_failure(case, job, options.takt)):
        print(f"{run.name:18} | {failure}", flush=True)
        verdict = dataclasses.replace(verdict, result="failed")
    shutil.rmtree(job / "lib", ignore_errors=True)
    (job / "takt.deb").unlink(missing_ok=True)
    hint = f": look at {job}/console.log, qemu.log and out/" if verdict.result in ("limit", "no verdict") else ""
    print(f"{run.name:18} | {verdict.result}, {time.monotonic() - options.began:.0f} s after the start{hint}", flush=True)
    return verdict


def run_all(runs: list[Run], image: pathlib.Path, options: argparse.Namespace) -> list[Verdict]:
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        running = [pool.submit(run_case, run, image, options) for run in runs]
        try:
            return [one.result() for one in running]
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def run_native(options: argparse.Namespace) -> int:
    programs = programs_of(options.package, options.out / "unpacked")
    command = [*([] if os.geteuid() == 0 else ["sudo"]), str(HERE / "lib/native.sh"), str(programs), str(TOP / "config")]
    return subprocess.run(command, check=False).returncode


def report(verdicts: list[Verdict], planted: bool, out: pathlib.Path, wall_s: float) -> int:
    print()
    for verdict in verdicts:
        print(f"{verdict.result:10}  {verdict.mode:7}  {verdict.wall_s:6.1f} s, cpu {verdict.cpu_s:6.1f} s  {verdict.case}")
    cpu_s = sum(verdict.cpu_s for verdict in verdicts)
    passed = sum(verdict.result in ("passed", "found") for verdict in verdicts)
    print(f"{passed} of {len(verdicts)} {'planted faults found' if planted else 'cases passed'} in {wall_s:.0f} s, with {cpu_s:.0f} s of qemu's processor time; what they left: {out}")
    rows = [dataclasses.asdict(verdict) for verdict in verdicts]
    (out / "summary.json").write_text(json.dumps({"wall_s": round(wall_s, 1), "cpu_s": round(cpu_s, 1), "cases": rows}, indent=1) + "\n")
    return 0 if passed == len(verdicts) else EXIT_FAILED


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.error = lambda message: sys.exit(refuse(EXIT_USAGE, message))  # type: ignore[method-assign,assignment]
    parser.add_argument("filter", nargs="?", help="regular expression on the cases' names")
    parser.add_argument("--list", action="store_true", help="name the cases and end")
    parser.add_argument("--planted", action="store_true", help="run each case with each fault that its header plants: it must fail")
    parser.add_argument("--native", action="store_true", help="run what needs no guest on this machine's own vcan")
    parser.add_argument("--package", type=pathlib.Path, help="folder with the takt_*.deb that is tested")
    parser.add_argument("--tool", type=pathlib.Path, action="append", default=[], help="program that cases need beside Takt")
    parser.add_argument("--cases", type=pathlib.Path, default=HERE / "cases", help="folder of cases")
    parser.add_argument("--out", type=pathlib.Path, default=TOP / "build/hil/results")
    parser.add_argument("--jobs", type=int, default=2, help="guests at a time")
    parser.add_argument("--wall-limit", type=float, default=1200,
                        help="s per case, for guests that hang; a case's own limit is of the guest's time")
    return parser.parse_args()


def refuse(code: int, sentence: str) -> int:
    print(f"hil: {sentence}", file=sys.stderr)
    return code


def main() -> int:
    options = arguments()
    try:
        cases = matching(all_cases(options.cases), options.filter)
        runs = [run for case in cases for run in runs_of(case, options.planted)]
    except BadCase as problem:
        return refuse(EXIT_USAGE, str(problem))
    if not cases:
        return refuse(EXIT_USAGE, f"no case matches {options.filter!r}: --list names them")
    if options.list:
        for case in cases:
            print(f"{case.name:18} {case.mode:8} {case.goal}")
        return 0
    if not options.package:
        return refuse(EXIT_USAGE, "--package is missing: a folder with a takt_*.deb, which ./dev package makes")
    try:
        options.package = package_in(options.package)
    except BadPackage as problem:
        return refuse(EXIT_USAGE, str(problem))
    if options.native:
        return run_native(options)
    if not shutil.which(QEMU):
        return refuse(EXIT_UNAVAILABLE, f"{QEMU} is not installed: apt install qemu-system-x86")
    options.out = options.out.resolve()
    options.began = time.monotonic()
    try:
        image = build_guest(options.package)
        options.takt = programs_of(options.package, options.out / "unpacked") / "takt"
        verdicts = run_all(runs, image, options)
    except (BadPackage, NotSaved) as problem:
        return refuse(EXIT_UNAVAILABLE, str(problem))
    except NotInstalled as problem:
        return refuse(EXIT_FAILED, f"Takt does not install in the guest: {problem}")
    except KeyboardInterrupt:
        return refuse(EXIT_INTERRUPTED, "interrupted")
    return report(verdicts, options.planted, options.out, time.monotonic() - options.began)


if __name__ == "__main__":
    sys.exit(main())
