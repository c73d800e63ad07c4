#!/usr/bin/env python3
"""Goal: the table of the headline panel in docs/panels.md is what today's program gives. Method: rows of the table,
drawn by its own bytes, are run again, all seeds and methods of each. On another kind of processor the last bit of a
sine differs, and a pole that falls late may stand: a cell may differ by what chance does to 50 rollouts. With --write
the whole panel is run and the table written.
Usage: headline_table.py REPOSITORY TAKT [--write]. Exit codes: 0 fine, 1 not.
"""
import collections
import json
import pathlib
import random
import subprocess
import sys
import tempfile

import yaml

BEGIN, END = "<!-- made by tests/docs/headline_table.py --write -->\n", "<!-- end of what it made -->\n"
METHODS = ("takt", "gate", "blind")
SAMPLE = 2


def panel_of(root):
    path = root / "config/panels/headline.yaml"
    panel = yaml.safe_load(path.read_text())
    for task in panel["tasks"]:
        task["robot"] = str((path.parent / task["robot"]).resolve())
    return panel


def rows_of(takt, panel):
    """{(task, perturbation, dose): [(method, successes, rollouts, mean ticks in violation)]}"""
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        (folder / "panel.yaml").write_text(yaml.safe_dump(panel, sort_keys=False))
        done = subprocess.run([takt, "panel", "run", folder / "panel.yaml", "--out", folder / "out", "--workers", "2"],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode != 0:
            sys.exit(f"takt panel run: {done.returncode}\n{done.stdout[-2000:]}")
        cells = collections.defaultdict(lambda: collections.defaultdict(list))
        for line in (folder / "out/rollouts.jsonl").read_text().splitlines():
            row = json.loads(line)
            cells[row["task"], row["perturbation"], row["dose"]][row["method"]].append((row["success"], row["constraint_violations"]))
    return {key: [(method, sum(s for s, _ in cell[method]), len(cell[method]), sum(v for _, v in cell[method]) / len(cell[method]))
                  for method in METHODS] for key, cell in cells.items()}


def line_of(key, cells):
    task, perturbation, dose = key
    return (f"| {task} | `{perturbation}` | {dose:g} | " + " | ".join(str(good) for _, good, _, _ in cells) +
            " | " + " | ".join(f"{violated:.1f}" for _, _, _, violated in cells) + " |")


def table_of(rows):
    head = ["| task | perturbation | dose | `takt` | `gate` | `blind` | ticks in violation: `takt` | `gate` | `blind` |",
            "|---|---|---:|---:|---:|---:|---:|---:|---:|"]
    return "\n".join(head + [line_of(key, rows[key]) for key in sorted(rows)]) + "\n"


def differences(told, key, cells):
    numbers = [float(cell) for cell in told[3:]]
    for (method, good, _, violated), told_good, told_violated in zip(cells, numbers[:3], numbers[3:]):
        if abs(good - told_good) > 7:
            yield f"{key}, {method}: {good} succeed, the page says {told_good:g}"
        if abs(violated - told_violated) > 5 + 0.3 * told_violated:
            yield f"{key}, {method}: {violated:.1f} ticks in violation, the page says {told_violated:g}"


def main():
    root, takt = pathlib.Path(sys.argv[1]), sys.argv[2]
    page = root / "docs/panels.md"
    before, _, rest = page.read_text().partition(BEGIN)
    table, _, after = rest.partition(END)
    panel = panel_of(root)
    if sys.argv[3:] == ["--write"]:
        page.write_text(before + BEGIN + table_of(rows_of(takt, panel)) + END + after)
        return
    told = [[cell.strip(" `") for cell in line.strip("|\n").split("|")] for line in table.splitlines()[2:]]
    found = []
    for row in random.Random(table).sample(told, SAMPLE):
        task, kind, dose = row[0], row[1], float(row[2])
        panel["perturbations"] = [{"kind": kind} if kind == "none" else {"kind": kind, "dose": dose}]
        panel["tasks"] = [each for each in panel_of(root)["tasks"] if each["task"] == task]
        rows = rows_of(takt, panel)
        found += differences(row, (task, kind, dose), rows[task, kind, dose])
    if found:
        sys.exit("\n".join(found) + "\ndocs/panels.md is of another program: tests/docs/headline_table.py . TAKT --write")
    print(f"{SAMPLE} of {len(told)} rows of the headline's table are today's")


main()
