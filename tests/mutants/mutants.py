#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Is every line that can break a promise watched by a test? Changes them one by one, and sees who notices (tests/mutants/README.md).

  mutants.py                        one mutant of each kind in each function, and every fault of faults.toml
  mutants.py --all                  every place there is: hours
  mutants.py --sample 40 [--seed 7] so many of them, and every fault; a larger sample of the same seed holds the smaller one
  mutants.py --for SECONDS          begins none after so long, the faults first of all, and says how many it left out
  mutants.py --first                each until the first program notices: quicker, and no matrix
  mutants.py 1a2b3c4d ...           these
  mutants.py --list                 their numbers, without running anything

Exit code 1: a fault of faults.toml survived, or passed the proof that tests/hazards names beside it, or fewer than 95 of 100 mutants were noticed that survivors.toml does not explain.
"""
import argparse
import collections
import concurrent.futures
import os
import pathlib
import subprocess
import sys
import time
import tomllib
import zlib

import judges
import schemata

HERE = pathlib.Path(__file__).parent
WANTED_SHARE = 0.95


def one_of_each_kind(mutants):
    """Of each operator one per function, always the same: that of the smallest number."""
    chosen = {}
    for mutant in mutants:
        place = (mutant.file, mutant.function, mutant.operator)
        if mutant.operator != "fault" and (place not in chosen or mutant.id < chosen[place].id):
            chosen[place] = mutant
    return [mutant for mutant in mutants if mutant.operator == "fault" or chosen[mutant.file, mutant.function, mutant.operator] is mutant]


class Explained:
    """survivors.toml: mutants that no oracle has to notice, and why. What an entry leaves out, may be anything."""
    FIELDS = ("file", "function", "operator", "change")

    def __init__(self, entries, mutants):
        self.why = {}
        for entry in entries:
            fit = [mutant for mutant in mutants if all(getattr(mutant, field) == entry[field] for field in self.FIELDS if field in entry)]
            if not fit:
                raise ValueError(f"survivors.toml: no such mutant any more, take it out: {entry}")
            for mutant in fit:
                self.why[mutant.id] = (entry["kind"], entry["why"])

    def excuses(self, mutant):
        return self.why.get(mutant.id, ("",))[0] in ("equivalent", "harmless")


def choose(mutants, arguments):
    if arguments.numbers:
        known = {mutant.id: mutant for mutant in mutants}
        unknown = [number for number in arguments.numbers if number not in known]
        if unknown:
            sys.exit(f"no such mutant: {', '.join(unknown)}; `./dev mutants --list` has them all")
        return [known[number] for number in arguments.numbers]
    if arguments.all:
        return mutants
    judged = one_of_each_kind(mutants)
    if not arguments.sample:
        return judged
    faults = [mutant for mutant in judged if mutant.operator == "fault"]
    # In an order of numbers that other mutants' coming and going does not change.
    others = sorted((mutant for mutant in judged if mutant.operator != "fault"),
                    key=lambda mutant: (zlib.crc32(f"{arguments.seed} {mutant.id}".encode()), mutant.id))
    return faults + others[:arguments.sample]


def judge(mutant, programs, memory, until_first):
    """{program: Outcome} of those that reach it, the quickest first."""
    outcomes = {}
    for program in sorted(programs, key=lambda one: one.wall_s):
        if mutant.id not in program.reaches:
            continue
        outcomes[program.name] = memory.outcome(mutant.id, program)
        if until_first and outcomes[program.name].killed:
            break
    return outcomes


def line_of(mutant, outcomes, explained):
    by = []
    for name, outcome in outcomes.items():
        if outcome.killed:
            who = outcome.oracles or outcome.tests[:2]
            more = "" if outcome.oracles or len(outcome.tests) < 3 else f" and {len(outcome.tests) - 2} more"
            by.append(f"{name}: {outcome.how + ' in ' if outcome.how else ''}{', '.join(who)}{more}")
    if by:
        verdict = "killed by " + "; ".join(by)
    else:
        verdict = "SURVIVED" if outcomes else "NOT REACHED"
        if mutant.id in explained.why:
            verdict += " ({}: {})".format(*explained.why[mutant.id])
    return f"{mutant.id} {mutant.file}:{mutant.line} {mutant.function} [{mutant.operator}] {mutant.change}\n    {verdict}"


def print_matrix(results):
    """How many each oracle and each program noticed, and how many of those no other did."""
    noticed, alone = collections.Counter(), collections.Counter()
    operators, killed = collections.Counter(), collections.Counter()
    for mutant, outcomes in results:
        witnesses = {f"program {name}" for name, outcome in outcomes.items() if outcome.killed}
        for oracle in {oracle for outcome in outcomes.values() for oracle in outcome.oracles}:
            noticed[f"oracle  {oracle}"] += 1
        noticed.update(witnesses)
        if len(witnesses) == 1:
            alone[witnesses.pop()] += 1
        operators[mutant.operator] += 1
        killed[mutant.operator] += any(outcome.killed for outcome in outcomes.values())
    print(f"\n{'noticed by':40} {'mutants':>8} {'alone':>6}")
    for name in sorted(noticed):
        print(f"{name:40} {noticed[name]:8} {alone[name] if name.startswith('program') else '':>6}")
    print(f"\n{'operator':40} {'mutants':>8} {'killed':>6}")
    for name in sorted(operators):
        print(f"{name:40} {operators[name]:8} {killed[name]:6}")


def sum_up(results, explained, until_first):
    """Prints matrix, survivors and score; returns the exit code."""
    if not until_first:
        print_matrix(results)
    survivors = [(mutant, outcomes) for mutant, outcomes in results if not any(outcome.killed for outcome in outcomes.values())]
    excused = [one for one in survivors if explained.excuses(one[0])]
    open_ones = [one for one in survivors if not explained.excuses(one[0])]
    print(f"\nsurvivors that nobody has to notice: {len(excused)}; others: {len(open_ones)}")
    for mutant, outcomes in open_ones:
        print(line_of(mutant, outcomes, explained))
    kills = len(results) - len(survivors)
    counted = kills + len(open_ones)
    share = kills / counted if counted else 1.0
    print(f"\n{len(results)} mutants, {kills} killed; of the {counted} that can break a promise {100 * share:.1f} %")
    lost = [mutant for mutant, _ in open_ones if mutant.operator == "fault"]
    for mutant in lost:
        print(f"a fault that must be noticed survived: {mutant.change}")
    return 1 if lost or share < WANTED_SHARE else 0


def unnoticed_by_proofs(tree, mutants):
    """Faults that a row of the hazard table names and none of its proofs notices. Proofs that are no judge's are not asked."""
    numbers = {mutant.change: mutant.id for mutant in mutants if mutant.operator == "fault"}
    judged = set(tree.scope["judges"])
    said = subprocess.run([tree.build / "bin/hazard_page", "--mutants"], check=True, capture_output=True, text=True).stdout
    for name, *proofs in (line.split("\t") for line in said.splitlines()):
        asked = [proof.split(" ") for proof in proofs if proof.split(" ")[0] in judged]
        programs = [judges.Program(tree.build, program, [f"--gtest_filter={case}:*/{case}/*:{case}/*:*/{case}"], tree.folder)
                    for program, case in asked]
        if name in numbers and not any(program.run(numbers[name])[0].killed for program in programs):
            yield f"no proof notices what tests/hazards says it does: {name}: {', '.join(proofs)}"


def arguments_of(words):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("numbers", nargs="*", metavar="NUMBER")
    parser.add_argument("--all", action="store_true")
    parser.add_argument("--sample", type=int)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--for", dest="seconds", type=float, default=float("inf"))
    parser.add_argument("--first", action="store_true")
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--in", dest="where", default="", metavar="TEXT", help="only of files whose path has this text")
    parser.add_argument("--jobs", type=int, default=2)
    return parser.parse_args(words)


def main():
    arguments = arguments_of(sys.argv[1:])
    began = time.monotonic()
    scope = tomllib.loads((HERE / "scope.toml").read_text())
    tree = schemata.Tree(os.getcwd(), scope)
    tree.configure()
    if arguments.list:
        tree.rewrite()
    else:
        tree.make([*scope["judges"], "hazard_page"])
    explained = Explained(tomllib.loads((HERE / "survivors.toml").read_text())["survivor"], tree.mutants)
    chosen = [mutant for mutant in choose(tree.mutants, arguments) if arguments.where in mutant.file]
    if arguments.list:
        for mutant in chosen:
            print(f"{mutant.id} {mutant.file}:{mutant.line} {mutant.function} [{mutant.operator}] {mutant.change}")
        return 0
    built = time.monotonic()
    programs = [judges.Program(tree.build, name, extra, tree.folder) for name, extra in scope["judges"].items()]
    memory = judges.Memory(tree.root / "build/mutants/outcomes.jsonl")
    results = []

    def judge_in_time(mutant):
        """None: there was no time left to look."""
        in_time = time.monotonic() - began < arguments.seconds
        return judge(mutant, programs, memory, arguments.first) if in_time else None

    with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
        list(pool.map(lambda program: program.look_at_original(), programs))
        work = {pool.submit(judge_in_time, mutant): mutant for mutant in chosen}
        for done in concurrent.futures.as_completed(work):
            if done.result() is None:
                continue
            results.append((work[done], done.result()))
            print(f"{len(results)}/{len(chosen)} {line_of(*results[-1], explained)}", flush=True)
    results.sort(key=lambda one: (one[0].file, one[0].line, one[0].id))
    code = sum_up(results, explained, arguments.first)
    for unnoticed in unnoticed_by_proofs(tree, [mutant for mutant, _ in results]):
        print(unnoticed)
        code = 1
    if len(results) < len(chosen):
        print(f"{len(chosen) - len(results)} of {len(chosen)} mutants were left out: --for {arguments.seconds:.0f}")
    print(f"{built - began:.0f} s to find and build, {time.monotonic() - built:.0f} s to run")
    return code


if __name__ == "__main__":
    sys.exit(main())
