#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the table of docs/panels.md on what the fault classifier names: runs the three panels, and reads their confusion.json.
`ctest -R lab_classifier_panels` holds a sample of the same panels to floors. Usage: classifier_table.py REPOSITORY TAKT [--artifacts DIR]:
with --artifacts it runs nothing and reads DIR/classifier, DIR/doses and DIR/mixtures."""
import json
import pathlib
import subprocess
import sys
import tempfile

BEGIN, END = "<!-- made by tests/docs/classifier_table.py -->\n", "<!-- end of what it made -->\n"
PANELS = ("classifier", "doses", "mixtures")


def run(root, takt, folder):
    for panel in PANELS:
        subprocess.run([takt, "panel", "run", root / f"config/panels/{panel}.yaml", "--out", folder / panel, "--workers", "2"],
                       check=True, stdout=subprocess.DEVNULL)


def lines_of(folder):
    whole = {panel: json.loads((folder / panel / "confusion.json").read_text()) for panel in PANELS}
    classifier, doses, mixtures = (whole[panel]["methods"]["takt"] for panel in PANELS)
    pairs = mixtures["mixtures"]
    precision = min(one["precision"] for one in pairs["causes"].values() if one["planted"] > 0)
    single = [(sum(sum(cause["verdicts"].values()) for cause in one["planted"].values()), one["without_trouble"], f"{one['macro_recall']:.3f}; {one['macro_recall_of_troubled']:.3f}",
               f"{one['macro_precision']:.3f}", one["named_besides"]) for one in (classifier, doses)]
    of_pairs = (f"{pairs['rollouts']}, of two causes", "-", f"both named in {pairs['all_named'] / pairs['rollouts']:.3f}",
                f"least of a planted cause: {precision:.3f}", sum(round(one["named"] * (1 - one["precision"])) for one in pairs["causes"].values()))
    names = ("rollouts with a planted cause", "without any trouble, so without a verdict", "macro recall; of rollouts with trouble", "macro precision",
             "another cause named besides")
    yield "| | classifier | doses | mixtures |"
    yield "|---|---|---|---|"
    for name, *cells in zip(names, *single, of_pairs):
        yield f"| {name} | " + " | ".join(str(cell) for cell in cells) + " |"
    nominal = [f"{one['nominal']['labelled']} of {one['nominal']['rollouts']}" for one in (classifier, doses, mixtures)]
    yield "| nominal rollouts with a verdict | " + " | ".join(nominal) + " |"
    yield "| artifact | " + " | ".join(whole[panel]["artifact_id"] for panel in PANELS) + " |"


def main():
    root, takt = pathlib.Path(sys.argv[1]), sys.argv[2]
    page = root / "docs/panels.md"
    before, _, rest = page.read_text().partition(BEGIN)
    after = rest.partition(END)[2]
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(sys.argv[4] if sys.argv[3:4] == ["--artifacts"] else made)
        if folder == pathlib.Path(made):
            run(root, takt, folder)
        page.write_text(before + BEGIN + "\n".join(lines_of(folder)) + "\n" + END + after)


if __name__ == "__main__":
    main()
