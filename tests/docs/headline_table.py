#!/usr/bin/env python3
"""Goal: the table of the headline panel in docs/panels.md is what today's program gives. Method: rows of the table,
drawn by its own bytes, are run again, all seeds and methods of each. On another kind of processor the last bit of a
sine differs, and a pole that falls late may stand: a cell may differ by what chance does to 50 rollouts. With --write
the whole panel is run and the table written, below the sentence that says how Takt fares against its best rival; with
--verdict ROLLOUTS that sentence is printed of these rows.
Usage: headline_table.py REPOSITORY TAKT [--write | --verdict ROLLOUTS.jsonl]. Exit codes: 0 fine, 1 not.
"""
import collections
import json
import math
import pathlib
import random
import subprocess
import sys
import tempfile

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


def verdict(rollouts):
    """One sentence: Takt against the rival that succeeds most often, of those that do the one with the fewest ticks in violation."""
    def summary(method):
        rows = rollouts[method].values()
        return sum(good for good, _ in rows), -sum(violated for _, violated in rows) / len(rows)
    rival = max((method for method in rollouts if method != "takt"), key=summary)
    ours, theirs = rollouts["takt"], rollouts[rival]
    only_takt = sum(ours[key][0] > theirs[key][0] for key in ours)
    only_rival = sum(ours[key][0] < theirs[key][0] for key in ours)
    apart = only_takt + only_rival
    chance = min(1.0, 2 * sum(math.comb(apart, k) for k in range(min(only_takt, only_rival) + 1)) / 2 ** apart)
    how = "ties with" if chance >= SURE else "beats" if only_takt > only_rival else "LOSES to"
    (good, violated), (their_good, their_violated) = summary("takt"), summary(rival)
    return (f"Takt {how} its best rival, `{rival}`: {good} against {their_good} of {len(ours)} rollouts succeed, {only_takt} by Takt alone and "
            f"{only_rival} by `{rival}` alone (exact p {chance:.2g} over rollouts); {-violated:.1f} against {-their_violated:.1f} ticks in violation per rollout.")


def run(takt, panel):
    """Every rollout of the panel, as rollouts_of has them."""
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        (folder / "panel.yaml").write_text(yaml.safe_dump(panel, sort_keys=False))
        done = subprocess.run([takt, "panel", "run", folder / "panel.yaml", "--out", folder / "out", "--workers", "2"],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode != 0:
            sys.exit(f"takt panel run: {done.returncode}\n{done.stdout[-2000:]}")
        return rollouts_of(folder / "out/rollouts.jsonl")


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
        print(verdict(rollouts_of(pathlib.Path(sys.argv[4]))))
        return
    page = root / "docs/panels.md"
    before, _, rest = page.read_text().partition(BEGIN)
    made, _, after = rest.partition(END)
    panel = panel_of(root)
    if sys.argv[3:] == ["--write"]:
        rollouts = run(takt, panel)
        page.write_text(before + BEGIN + verdict(rollouts) + "\n\n" + table_of(rows_of(rollouts)) + END + after)
        return
    table = made[made.index("| task"):]
    told = [[cell.strip(" `") for cell in line.strip("|\n").split("|")] for line in table.splitlines()[2:]]
    found = []
    for row in random.Random(table).sample(told, SAMPLE):
        task, kind, dose = row[0], row[1], float(row[2])
        panel["perturbations"] = [{"kind": kind} if kind == "none" else {"kind": kind, "dose": dose}]
        panel["tasks"] = [each for each in panel_of(root)["tasks"] if each["task"] == task]
        found += differences(row, (task, kind, dose), rows_of(run(takt, panel))[task, kind, dose])
    if found:
        sys.exit("\n".join(found) + "\ndocs/panels.md is of another program: tests/docs/headline_table.py . TAKT --write")
    print(f"{SAMPLE} of {len(told)} rows of the headline's table are today's")


if __name__ == "__main__":
    main()
