#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the table of the headline panel in docs/panels.md is what today's program gives. Method: rows of the table,
drawn by its own bytes, are run again, all seeds and methods of each. On another kind of processor the last bit of a
sine differs, and a pole that falls late may stand: a cell may differ by what chance does to 50 rollouts. With --write
the whole panel is run and the table written, below the sentence that says how Takt fares against its best rival by
`takt compare`; with --verdict ARTIFACT that sentence is printed of this panel's artifact.
Usage: headline_table.py REPOSITORY TAKT [--write | --verdict ARTIFACT]. Exit codes: 0 fine, 1 not.
"""
import collections
import json
import pathlib
import random
import subprocess
import sys
import tempfile
import textwrap

import yaml

BEGIN, END = "<!-- made by tests/docs/headline_table.py --write -->\n", "<!-- end of what it made -->\n"
METHODS = ("takt", "timeout", "plain", "gate", "blind")
VIOLATED = ("takt", "timeout", "blind")  # whose ticks in violation the table has
SURE = 0.05
SAMPLE = 2


def panel_of(root):
    path = root / "config/panels/headline.yaml"
    panel = yaml.safe_load(path.read_text())
    for task in panel["tasks"]:
        task["robot"] = str((path.parent / task["robot"]).resolve())
    return panel


def rollouts_of(path):
    """{method: {(task, perturbation, dose, seed): (success, ticks in violation)}}"""
    methods = collections.defaultdict(dict)
    for line in path.read_text().splitlines():
        row = json.loads(line)
        methods[row["method"]][row["task"], row["perturbation"], row["dose"], row["seed"]] = (row["success"], row["constraint_violations"])
    return methods


def against(takt, artifact, rival):
    """The pooled comparison of Takt with one rival: successes, and ticks in violation."""
    said = subprocess.run([takt, "compare", artifact, "--method-a", "takt", "--method-b", rival, "--json"], capture_output=True, text=True)
    if said.returncode != 0:
        sys.exit(f"takt compare: {said.returncode}\n{said.stderr}")
    pooled = json.loads(said.stdout)["pooled"]
    violated = next(metric for metric in pooled["metrics"] if metric["metric"] == "constraint_violations")
    return pooled["pairs"], pooled["success"], violated["mean_a"], violated["mean_b"]


def verdict(takt, artifact):
    """One sentence: Takt against the rival that succeeds most often, of those that do the one with the fewest ticks in violation."""
    compared = {rival: against(takt, artifact, rival) for rival in METHODS if rival != "takt"}
    rival = max(compared, key=lambda name: (compared[name][1]["both"] + compared[name][1]["only_b"], -compared[name][3]))
    pairs, success, ours, theirs = compared[rival]
    how = "ties with" if success["exact_p"] >= SURE else "beats" if success["only_a"] > success["only_b"] else "LOSES to"
    return (f"Takt {how} its best rival, `{rival}`: {success['both'] + success['only_a']} against {success['both'] + success['only_b']} "
            f"of {pairs} rollouts succeed, {success['only_a']} by Takt alone and {success['only_b']} by `{rival}` alone "
            f"(exact p over {success['seeds']} seeds {success['exact_p']:.2g}); {ours:.1f} against {theirs:.1f} ticks in violation per rollout.")


def run(takt, panel, look=lambda artifact: None):
    """Every rollout of the panel, as rollouts_of has them, and what `look` sees in its artifact."""
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        (folder / "panel.yaml").write_text(yaml.safe_dump(panel, sort_keys=False))
        done = subprocess.run([takt, "panel", "run", folder / "panel.yaml", "--out", folder / "out", "--workers", "2"],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode != 0:
            sys.exit(f"takt panel run: {done.returncode}\n{done.stdout[-2000:]}")
        return rollouts_of(folder / "out/rollouts.jsonl"), look(folder / "out")


def rows_of(rollouts):
    """{(task, perturbation, dose): {method: (successes, mean ticks in violation)}}"""
    cells = collections.defaultdict(lambda: collections.defaultdict(list))
    for method, rows in rollouts.items():
        for key, row in rows.items():
            cells[key[:3]][method].append(row)
    return {key: {method: (sum(s for s, _ in cell[method]), sum(v for _, v in cell[method]) / len(cell[method])) for method in METHODS}
            for key, cell in cells.items()}


def line_of(key, cell):
    task, perturbation, dose = key
    return (f"| {task} | `{perturbation}` | {dose:g} | " + " | ".join(str(cell[method][0]) for method in METHODS) +
            " | " + " | ".join(f"{cell[method][1]:.1f}" for method in VIOLATED) + " |")


def table_of(rows):
    violated = [f"`{method}`" for method in VIOLATED]
    head = ["| task | perturbation | dose | " + " | ".join(f"`{method}`" for method in METHODS) + " | ticks in violation: " + " | ".join(violated) + " |",
            "|---|---|" + "---:|" * (1 + len(METHODS) + len(VIOLATED))]
    return "\n".join(head + [line_of(key, rows[key]) for key in sorted(rows)]) + "\n"


def differences(told, key, cell):
    numbers = [float(number) for number in told[3:]]
    for method, said in zip(METHODS, numbers):
        if abs(cell[method][0] - said) > 7:
            yield f"{key}, {method}: {cell[method][0]} succeed, the page says {said:g}"
    for method, said in zip(VIOLATED, numbers[len(METHODS):]):
        if abs(cell[method][1] - said) > 5 + 0.3 * said:
            yield f"{key}, {method}: {cell[method][1]:.1f} ticks in violation, the page says {said:g}"


def main():
    root, takt = pathlib.Path(sys.argv[1]), sys.argv[2]
    if sys.argv[3:4] == ["--verdict"]:
        print(verdict(takt, sys.argv[4]))
        return
    page = root / "docs/panels.md"
    before, _, rest = page.read_text().partition(BEGIN)
    made, _, after = rest.partition(END)
    panel = panel_of(root)
    if sys.argv[3:] == ["--write"]:
        rollouts, sentence = run(takt, panel, lambda artifact: verdict(takt, artifact))
        page.write_text(before + BEGIN + textwrap.fill(sentence, 120) + "\n\n" + table_of(rows_of(rollouts)) + END + after)
        return
    table = made[made.index("| task"):]
    told = [[cell.strip(" `") for cell in line.strip("|\n").split("|")] for line in table.splitlines()[2:]]
    found = []
    for row in random.Random(table).sample(told, SAMPLE):
        task, kind, dose = row[0], row[1], float(row[2])
        panel["perturbations"] = [{"kind": kind} if kind == "none" else {"kind": kind, "dose": dose}]
        panel["tasks"] = [each for each in panel_of(root)["tasks"] if each["task"] == task]
        found += differences(row, (task, kind, dose), rows_of(run(takt, panel)[0])[task, kind, dose])
    if found:
        sys.exit("\n".join(found) + "\ndocs/panels.md is of another program: tests/docs/headline_table.py . TAKT --write")
    print(f"{SAMPLE} of {len(told)} rows of the headline's table are today's")


if __name__ == "__main__":
    main()
