#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""trace_picture.py TRACE.json OUT.svg: the tracks of a file for Perfetto, as a viewer of such files shows them: the constructed trace's
3 ms around its first arrow. Spans, counters and the arrows from an observation over the inference to its first use."""
import collections
import json
import sys

WIDTH, LEFT, SPAN_US, BEFORE_US = 1000, 190, 3_000, 700
TRACK, GAP, DEEPER = 24, 8, 18
COLOURS = {"tick": "#5794f2", "infer": "#3f9142", "drain": "#b877d9", "publish": "#ff9830"}


def escaped(text):
    return text.replace("&", "&amp;").replace("<", "&lt;")


def spans_of(events):
    """{(pid, tid): [(begin, end, name, depth)]} in us."""
    stacks, spans = collections.defaultdict(list), collections.defaultdict(list)
    for event in events:
        track = event["pid"], event["tid"]
        if event["ph"] == "B":
            stacks[track].append(event)
        elif event["ph"] == "E":
            begun = stacks[track].pop()
            spans[track].append((begun["ts"], event["ts"], begun["name"], len(stacks[track])))
    return spans


def counters_of(events):
    found = collections.defaultdict(list)
    for event in events:
        if event["ph"] == "C":
            found[event["pid"], event["name"]].append((event["ts"], float(next(iter(event["args"].values())))))
    return found


def drawn(events):
    processes = {e["pid"]: e["args"]["name"] for e in events if e["ph"] == "M" and e["name"] == "process_name"}
    threads = {(e["pid"], e["tid"]): e["args"]["name"] for e in events if e["ph"] == "M" and e["name"] == "thread_name"}
    begin = next(e["ts"] for e in events if e["ph"] == "s") - BEFORE_US
    across = lambda ts: LEFT + (WIDTH - LEFT - 10) * (ts - begin) / SPAN_US  # noqa: E731
    seen = lambda first, last: last >= begin and first <= begin + SPAN_US  # noqa: E731
    out, places, y = [], {}, 40
    for step in range(0, SPAN_US + 1, 500):
        x = across(begin + step)
        out.append(f'<path d="M{x:.1f} 24V999" class="g"/><text x="{x:.1f}" y="18" text-anchor="middle">+{step / 1000:g} ms</text>')
    for track, spans in sorted(spans_of(events).items()):
        depth = 1 + max((d for *_, d in spans), default=0)
        out.append(f'<text x="10" y="{y + 15}" class="t">{escaped(processes[track[0]])} / {escaped(threads[track])}</text>')
        places[track] = y
        for first, last, name, deep in spans:
            if seen(first, last):
                left, right = max(across(first), LEFT), min(across(last), WIDTH - 10)
                colour = next((c for word, c in COLOURS.items() if word in name), "#ff9830")
                out.append(f'<rect x="{left:.1f}" y="{y + deep * DEEPER}" width="{max(right - left, 1):.1f}" height="{DEEPER - 2}" fill="{colour}"/>')
                if right - left > 7 * len(name):
                    out.append(f'<text x="{left + 4:.1f}" y="{y + deep * DEEPER + 12}" class="i">{escaped(name)}</text>')
        y += depth * DEEPER + GAP
    for (pid, name), values in sorted(counters_of(events).items()):
        top = max((value for ts, value in values if seen(ts, ts)), default=0) or 1
        steps, last = [], None
        for ts, value in values:
            if seen(ts, ts):
                up = y + TRACK - (TRACK - 4) * value / top
                steps.append(f"M{across(ts):.1f} {up:.1f}" if last is None else f"H{across(ts):.1f}V{up:.1f}")
                last = up
        out.append(f'<text x="10" y="{y + 16}" class="t">{escaped(processes[pid])}: {escaped(name)}</text><path d="{"".join(steps)}" class="c"/>')
        y += TRACK + GAP
    at = collections.defaultdict(list)
    for event in events:
        if event["ph"] in "stf" and seen(event["ts"], event["ts"]):
            at[event["id"]].append((across(event["ts"]), places[event["pid"], event["tid"]] + DEEPER / 2))
    for steps in at.values():
        for (x0, y0), (x1, y1) in zip(steps, steps[1:]):
            out.append(f'<path d="M{x0:.1f} {y0:.1f}C{(x0 + x1) / 2:.1f} {y0:.1f} {(x0 + x1) / 2:.1f} {y1:.1f} {x1:.1f} {y1:.1f}" class="a"/>')
    looks = ("text{font:11px sans-serif;fill:#5c6773}.t{fill:#1f2933}.i{fill:#fff}.g{stroke:#e4e7eb}.c{fill:none;stroke:#3e4c59}"
             ".a{fill:none;stroke:#d64545;stroke-width:1.5;marker-end:url(#h)}")
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {y + 6}" role="img">\n<title>The tracks of a trace</title>\n<style>{looks}</style>\n'
            '<defs><marker id="h" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="6" markerHeight="6" orient="auto"><path d="M0 0L8 4L0 8Z" fill="#d64545"/></marker></defs>\n'
            f'<rect width="{WIDTH}" height="{y + 6}" fill="#fff"/>\n' + "\n".join(out) + "\n</svg>\n")


def main():
    with open(sys.argv[1], encoding="utf8") as file:
        svg = drawn(json.load(file)["traceEvents"])
    with open(sys.argv[2], "w", encoding="utf8") as file:
        file.write(svg)


main()
