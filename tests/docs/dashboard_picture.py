#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the Grafana dashboard shows a run: every one of its queries is answered by Prometheus, and the document's picture of it is today's.
Method: the scrapes of a robot in virtual time are imported into a real Prometheus, which answers each panel's query over the five
minutes; the panels are drawn from the dashboard's own titles, places, units and legends. Grafana itself is not asked.
Usage: dashboard_picture.py REPOSITORY MAKE_DASHBOARD_METRICS [--write]. Exit codes: 0 fine, 1 not, 77 Prometheus is not installed.
"""
import json
import math
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.parse
import urllib.request

BEGIN, SECONDS, STEP = 1_767_225_600, 300, 5
COLUMN, ROW, WIDTH = 42, 26, 24 * 42
COLOURS = ["#73bf69", "#f2cc0c", "#8ab8ff", "#ff780a", "#f2495c", "#b877d9", "#5794f2", "#37872d", "#fade2a", "#ca95e5", "#ff9830", "#96d98d"]
# A condition may hold at no time: none of these happened.
MAY_BE_EMPTY = re.compile(r"takt_bus_state.*> 0|:rate1h|:rate10m")


def recorded_rules(text):
    return dict(re.findall(r"- record: (\S+)\n\s+expr: (.+)", text))


def expanded(expr, rules):
    """Without recording rules, which only a running Prometheus evaluates; of one robot, so without their selectors."""
    while found := re.search(r"(takt:[\w:]+)(\{[^}]*\})?", expr):
        expr = expr[: found.start()] + f"({rules[found[1]]})" + expr[found.end() :]
    return expr.replace("$robot", ".*").replace("$instance", ".*")


class Prometheus:
    def __init__(self, scrapes, folder):
        subprocess.run(["promtool", "tsdb", "create-blocks-from", "openmetrics", scrapes, folder / "data"], check=True, capture_output=True)
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            self.url = f"http://127.0.0.1:{free.getsockname()[1]}"
        (folder / "prometheus.yml").write_text("{}\n")
        self.log = (folder / "log").open("w+")
        self.process = subprocess.Popen(
            ["prometheus", f"--config.file={folder}/prometheus.yml", f"--storage.tsdb.path={folder}/data", "--storage.tsdb.retention.time=100y",
             f"--web.listen-address={self.url[7:]}"], stdout=self.log, stderr=self.log)

    def __enter__(self):
        for _ in range(600):
            try:
                return urllib.request.urlopen(self.url + "/-/ready", timeout=5) and self
            except OSError:
                if self.process.poll() is not None:
                    break
                time.sleep(0.1)
        self.log.seek(0)
        raise SystemExit("prometheus does not answer: " + self.log.read()[-2000:])

    def __exit__(self, *_):
        self.process.terminate()
        self.process.wait(30)

    def series(self, expr):
        query = urllib.parse.urlencode({"query": expr, "start": BEGIN, "end": BEGIN + SECONDS, "step": STEP})
        with urllib.request.urlopen(f"{self.url}/api/v1/query_range?{query}", timeout=30) as answer:
            return json.load(answer)["data"]["result"]


def legend(target, labels):
    text = target.get("legendFormat") or "{{" + "}} {{".join(k for k in labels if k not in ("robot", "instance", "__name__")) + "}}"
    return re.sub(r"\{\{\s*(\w+)\s*\}\}", lambda m: "" if m[1] in ("robot", "instance") else labels.get(m[1], ""), text).strip() or "value"


def in_unit(value, unit):
    if unit == "s":
        for factor, name in ((1, "s"), (1e3, "ms"), (1e6, "µs")):
            if abs(value) * factor >= 1 or name == "µs":
                return f"{value * factor:.3g} {name}"
    return {"celsius": f"{value:.3g} °C", "percentunit": f"{100 * value:.3g} %"}.get(unit, f"{value:.3g}")


def escaped(text):
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def text_at(x, y, text, looks="", anchor="start"):
    return f'<text x="{x:.0f}" y="{y:.0f}" text-anchor="{anchor}" {looks}>{escaped(text)}</text>'


def points_of(series):
    return [(float(at) - BEGIN, float(value)) for at, value in series["values"] if math.isfinite(float(value))]


def drawn_lines(found, unit, left, top, width, height):
    values = [value for _, one in found for _, value in one]
    low, high = min(0.0, *values), max(0.0, *values)
    high = high if high > low else low + 1
    across = lambda at: left + width * at / SECONDS  # noqa: E731
    up = lambda value: top + height * (high - value) / (high - low)  # noqa: E731
    out = []
    for share in (0, 0.5, 1):
        value = low + share * (high - low)
        out.append(f'<path d="M{left:.0f} {up(value):.1f}h{width:.0f}" class="g"/>' + text_at(left - 6, up(value) + 3, in_unit(value, unit), "", "end"))
    for number, (_, one) in enumerate(found):
        path = " ".join(f"{across(at):.1f},{up(value):.1f}" for at, value in one)
        out.append(f'<polyline points="{path}" stroke="{COLOURS[number % len(COLOURS)]}"/>')
    return out


def drawn_states(found, left, top, width, height):
    out, row = [], height / max(len(found), 1)
    for number, (name, one) in enumerate(found):
        y = top + number * row
        out.append(text_at(left - 6, y + row / 2 + 3, name, "", "end"))
        out += [f'<rect x="{left + width * at / SECONDS:.1f}" y="{y + 2:.1f}" width="{width * STEP / SECONDS + 0.5:.1f}" height="{row - 4:.1f}" fill="{COLOURS[number % len(COLOURS)]}"/>'
                for at, _ in one if at < SECONDS]
    return out


def drawn_panel(panel, found):
    place, unit = panel["gridPos"], panel.get("fieldConfig", {}).get("defaults", {}).get("unit", "")
    x, y, width, height = place["x"] * COLUMN, place["y"] * ROW, place["w"] * COLUMN, place["h"] * ROW
    out = [f'<rect x="{x + 3}" y="{y + 3}" width="{width - 6}" height="{height - 6}" rx="3" class="p"/>', text_at(x + 14, y + 20, panel["title"], 'class="t"')]
    left, top, inner, below = x + 92, y + 32, width - 108, height - 48
    if not found:
        return out + [text_at(x + width / 2, y + height / 2, "No data", "", "middle")]
    if panel["type"] == "state-timeline":
        return out + drawn_states(found, left, top, inner, below)
    names = [name for name, _ in found][:8]
    out += drawn_lines(found, unit, left, top, inner, below - 22)
    at = left
    for number, name in enumerate(names):
        if at + 7 * len(name) + 26 > x + width:
            break
        out.append(f'<rect x="{at:.0f}" y="{y + height - 20}" width="10" height="3" fill="{COLOURS[number % len(COLOURS)]}"/>' + text_at(at + 14, y + height - 15, name))
        at += 7 * len(name) + 26
    return out


def picture(dashboard, rules, prometheus):
    """The SVG, and what is wrong with the dashboard's queries."""
    body, problems = [], []
    for panel in dashboard["panels"]:
        found = []
        for target in panel.get("targets", []):
            series = prometheus.series(expanded(target["expr"], rules))
            some = [(legend(target, one["metric"]), points_of(one)) for one in series]
            found += sorted((name, points) for name, points in some if points)
            if not series and not MAY_BE_EMPTY.search(target["expr"]):
                problems.append(f"{panel['title']}: {target['expr']}: no data")
        body += drawn_panel(panel, found)
    height = max(p["gridPos"]["y"] + p["gridPos"]["h"] for p in dashboard["panels"]) * ROW
    looks = "text{font:11px sans-serif;fill:#9fa7b3}.t{font-size:13px;fill:#d8d9da}.p{fill:#181b1f}.g{stroke:#2c3235}polyline{fill:none;stroke-width:1.5}"
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img">\n<title>{escaped(dashboard["title"])}</title>\n'
            f'<style>{looks}</style>\n<rect width="{WIDTH}" height="{height}" fill="#0b0c0e"/>\n' + "\n".join(body) + "\n</svg>\n"), problems


def main():
    root, make = pathlib.Path(sys.argv[1]), sys.argv[2]
    if not (shutil.which("prometheus") and shutil.which("promtool")):
        print("SKIPPED: Prometheus is not installed (package prometheus): the dashboard was not looked at")
        return 77
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run([make, folder / "scrapes"], cwd=root, check=True)
        rules = recorded_rules((root / "config/prometheus/takt.rules.yaml").read_text())
        with Prometheus(folder / "scrapes", folder) as prometheus:
            drawn, problems = picture(json.loads((root / "config/grafana/takt.json").read_text()), rules, prometheus)
    committed = root / "docs/pictures/dashboard.svg"
    if "--write" in sys.argv:
        committed.write_text(drawn)
    elif committed.read_text() != drawn:
        problems.append("docs/pictures/dashboard.svg is not what today's sources draw: ./dev pictures")
    print("\n".join(problems) or "every panel has data, and the picture is today's")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
