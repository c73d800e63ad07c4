#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a file that docs/duties.md names for a duty holds what the page says. Method: the page's table stands here; a robot is started, armed, stopped and
reset, its robot file is changed and it is started again, another deployment comes into use; then every row's fields are looked up in what that left, the page's
own lines check the chain of the log, a torn line in it, and an altered log fails them.
Usage: duties_page.py REPOSITORY BIN, or duties_page.py REPOSITORY --write: the table into the page.
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent / "process")]
BEGIN, END = "<!-- made by tests/docs/duties_page.py -->\n", "<!-- end of what it made -->\n"
MACHINERY, AI = "Machinery Regulation", "AI Act"
LOG = "interventions"
# Text, article, what is asked in our words, file, fields (in lines of the log: of a line with that `what`), how long.
ROWS = [
    (MACHINERY, "III 1.1.9", "software and data that safety rests on are identified",
     "run/manifest.json", ["config.sha256", "policy.sha256", "executive.sha256"], "as long as the run"),
    (MACHINERY, "III 1.1.9", "which software is installed can be told at any time", LOG, ["start: takt", "start: executive_sha256", "start: policy_sha256"], "5 years"),
    (MACHINERY, "III 1.1.9", "evidence of a change of software or settings, permitted or not",
     LOG, ["start: changed", "start: config_sha256_before", "deploy: deployment_before", "deploy: deployment"], "5 years"),
    (MACHINERY, "III 1.1.9", "protection of both against corruption", "store/deployments/*/tried", ["robot.yaml"], "as long as the deployment"),
    (MACHINERY, "III 1.2.1", "a log of interventions", LOG, ["press stop: who.uid", "arm: who.uid", "reset: done", "arm: at"], "5 years"),
    (MACHINERY, "III 1.2.1", "versions of safety software that were uploaded", LOG, ["start: takt", "start: config_sha256", "deploy: takt"], "5 years"),
    (MACHINERY, "III 1.2.1", "data on decisions, where behaviour evolves by itself: one year", "run/ticks.mcap", [], "`record.keep`"),
    (AI, "12 (1)", "events are recorded by themselves, over the system's life", "run/transitions.jsonl", ["cause", "utc"], "`record.keep`; with an incident: until you delete it"),
    (AI, "12 (2) a", "situations that may be a risk, and substantial modifications", "run/metrics.json", ["incidents"], "as the run"),
    (AI, "12 (2) a", "the same: what was modified", LOG, ["start: changed"], "5 years"),
    (AI, "12 (2) b, c", "monitoring after sale and in use", "run/metrics.json", ["deadline_misses", "requests"], "as the run"),
    (AI, "19, 26 (6)", "logs stay for six months at least", "run/config.yaml", ["record"], "`record.keep: { days: 183 }` or more, or no limit"),
]


def table():
    yield "| text | asks for | file | fields | how long |"
    yield "|---|---|---|---|---|"
    for law, article, asked, file, fields, kept in ROWS:
        yield f"| {law} {article} | {asked} | `{file}` | {', '.join(f'`{one}`' for one in fields) or 'all'} | {kept} |"


def with_table(page):
    before, _, rest = page.partition(BEGIN)
    return before + BEGIN + "\n".join(table()) + "\n" + END + rest.partition(END)[2]


def value(json_object, path):
    for name in path.split("."):
        if not isinstance(json_object, dict) or name not in json_object:
            return None
        json_object = json_object[name]
    return json_object


def missing(place):
    """Of what the page names, what `place` does not have: sentences."""
    lines = [json.loads(line) for file in sorted((place / LOG).glob("*.jsonl")) for line in file.read_text().splitlines()]
    for _, _, _, file, fields, _ in ROWS:
        if file == LOG:
            for field in fields:
                what, _, path = field.partition(": ")
                if not any(line["what"] == what and value(line, path) not in (None, "") for line in lines):
                    yield f"no line of the log has {field}"
            continue
        found = sorted(place.glob(file))
        if not found:
            yield f"no {file}"
        for field in fields:
            text = found[0].read_text() if found else ""
            whole = json.loads(text.splitlines()[0] if file.endswith("jsonl") else text) if file.endswith((".json", ".jsonl")) else None
            if (value(whole, field) is None) if whole is not None else field not in text:
                yield f"{file} has no {field}"


def chain_check(page):
    return re.search(r"```python\n(.*?)```", page, re.S)[1]


def live(root, programs, place):
    """What a robot's life leaves in `place`."""
    from operated import Operated
    from patient import patient
    (place / LOG).mkdir()
    (place / "config").mkdir()
    for file in (root / "config").iterdir():
        if file.is_file():
            (place / "config" / file.name).write_bytes(file.read_bytes())
    robot_file = place / "config" / "arm6.yaml"
    robot_file.write_text(patient(robot_file.read_text()).replace("directory: runs", f"directory: {place / 'runs'}"))
    robot = Operated(programs, place / "sockets")
    for run in ("first", "run"):
        process = robot.start(robot_file, place / run, duration="60s")
        assert robot.get_going(), "it never tracked"
        robot.ask("stop")
        assert robot.wait_until(lambda status: status.get("mode") == "damped_stop")
        assert robot.wait_until(lambda status: status.get("mode") == "standby" or robot.ask("reset") is None), "it was never reset"
        process.terminate()
        said, _ = process.communicate(timeout=60)
        assert (place / run / "metrics.json").exists(), said
        robot_file.write_text(robot_file.read_text().replace("max_age: 150 ms", "max_age: 140 ms"))
    for name in ("one", "two"):
        deploy(programs, place, name)


def deploy(programs, place, name):
    deployed = subprocess.run([programs / "takt", "deploy", place / "config/arm6.yaml", "--store", place / "store", "--name", name, "--no-restart",
                               "--runs", place / "runs", "--runtime-dir", place / "nowhere"], capture_output=True, text=True, check=False)
    assert deployed.returncode == 0 and "note: not in a log" not in deployed.stderr, deployed.stderr


def tear(log):
    """As a power failure does, in the middle of a line."""
    with open(log, "a", encoding="utf8") as file:
        file.write('{"at":"20')


def chain(root, folder):
    """What the page's own lines say of a log."""
    checked = subprocess.run([sys.executable, "-c", chain_check((root / "docs/duties.md").read_text()), folder], capture_output=True, text=True, check=False)
    return checked.returncode, checked.stdout + checked.stderr


def main():
    root = pathlib.Path(sys.argv[1]).resolve()
    page = root / "docs/duties.md"
    if sys.argv[2] == "--write":
        page.write_text(with_table(page.read_text()))
        return 0
    wrong = [] if with_table(page.read_text()) == page.read_text() else ["docs/duties.md: run tests/docs/duties_page.py . --write"]
    with tempfile.TemporaryDirectory() as scratch:
        place = pathlib.Path(scratch)
        live(root, pathlib.Path(sys.argv[2]).resolve(), place)
        wrong += missing(place)
        log = next(iter((place / LOG).glob("*.jsonl")))
        sizes = {what: [len(line) for line in log.read_text().splitlines() if f'"what":"{what}"' in line] for what in ("arm", "deploy", "start")}
        wrong += [f"lines of {what} have {sizes[what]} bytes: correct docs/duties.md" for what, most in (("arm", 260), ("deploy", 500), ("start", 550))
                  if min(sizes[what]) > most]
        tear(log)
        deploy(pathlib.Path(sys.argv[2]).resolve(), place, "three")
        whole = log.read_text()
        code, said = chain(root, place / LOG)
        wrong += [] if code == 0 and "is torn" in said else [f"a log with a torn line: {code}, {said}"]
        log.write_text(whole.replace('"arm"', '"mra"', 1))
        code, said = chain(root, place / LOG)
        wrong += [] if code == 1 and "does not follow" in said else [f"an altered log: {code}, {said}"]
    print("\n".join(wrong) or "every file and field of the page is there")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
