#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: of thirty computers that run one robot file, an alert names the computer that is in trouble, and no other. Method:
promtool's own test of the shipped rules, with thirty instances of one robot name, a trouble planted for each alert on a
computer of its own, and beside it what must not page: a stop that an operator asked for, a fallback that is missing in standby.
Usage: fleet_rules_test.py RULES"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile

COMPUTERS, SAMPLES, BEGINS = 30, 280, 240  # four samples a minute; the trouble begins after an hour
TROUBLE = {  # alert: on which computers
    "TaktFreshnessBurnsFast": [1],
    "TaktFreshnessBurnsSlowly": [1, 2],
    "TaktStopped": [3, 4],
    "TaktDegraded": [6],
    "TaktWithoutFallback": [7],
    "TaktDown": [10],
    "TaktMonitorDown": [11],
    "TaktUnrecorded": [12],
    "TaktBusTrouble": [13],
    "TaktDiskFull": [15],
    "TaktLoopLate": [14],
}


def changes(before, after):
    return f"{before}x{BEGINS} {after}x{SAMPLES - BEGINS}"


def series_of(number):
    def one(name, values, **labels):
        labels = {"robot": "arm6", "instance": f"pc{number:02}:9464", "job": "takt", **labels}
        said = ",".join(f'{key}="{value}"' for key, value in labels.items())
        return {"series": f"{name}{{{said}}}", "values": values}

    modes = {3: "fault_latched", 4: "damped_stop", 5: "damped_stop", 6: "degraded", 9: "standby"}
    mode = modes.get(number, "tracking")
    misses = {1: 1500, 2: 300}.get(number, 15)
    late = 1000 if number == 14 else 0
    yield one("takt_relied_ticks_total", f"0+15000x{SAMPLES}")
    yield one("takt_deadline_misses_total", f"0+{misses}x{SAMPLES}")
    yield one("takt_freshness_epsilon_ratio", f"0.01x{SAMPLES}")
    yield one("takt_control_period_seconds", f"0.001x{SAMPLES}")
    for bound, each in (("0.0001", 15000 - late), ("0.001", 15000), ("+Inf", 15000)):
        yield one("takt_wakeup_lateness_seconds_bucket", f"0+{each}x{SAMPLES}", le=bound)
    if mode == "tracking":
        yield one("takt_mode", f"1x{SAMPLES}", mode=mode)
    else:
        yield one("takt_mode", changes(1, 0), mode="tracking")
        yield one("takt_mode", changes(0, 1), mode=mode)
    if number == 3:
        yield one("takt_incident", changes("_", 1), mode=mode, cause="drive_fault", where="joint elbow", asked="no")
    if number == 5:
        yield one("takt_incident", changes("_", 1), mode=mode, cause="operator_stop", where="arm6", asked="yes")
    if number != 8:  # it has none
        yield one("takt_fallback_usable", changes(1, 0) if number in (7, 9) else f"1x{SAMPLES}")
    yield one("takt_up", changes(1, 0) if number == 10 else f"1x{SAMPLES}")
    up = one("up", changes(1, 0) if number == 11 else f"1x{SAMPLES}")
    up["series"] = up["series"].replace('robot="arm6",', "")
    yield up
    lost = f"0x{BEGINS} 7x{SAMPLES - BEGINS}" if number == 12 else f"0x{SAMPLES}"
    yield one("takt_record_losses_total", lost, ring="tick", reason="overwritten")
    yield one("takt_record_hours_left", changes(200, 5) if number == 15 else "1000000x280" if number == 16 else f"200x{SAMPLES}")
    yield one("takt_bus_state", changes(0, 1) if number == 13 else f"0x{SAMPLES}", bus="can1", state="bus_off")


def fired(rules):
    """By alert the computers that promtool says it fires for, told by expecting none."""
    at = {alert: BEGINS + 12 if alert == "TaktUnrecorded" else SAMPLES for alert in TROUBLE}
    tests = [{"interval": "15s", "input_series": [one for number in range(COMPUTERS) for one in series_of(number)],
              "alert_rule_test": [{"eval_time": f"{15 * sample}s", "alertname": alert, "exp_alerts": []} for alert, sample in at.items()]}]
    with tempfile.TemporaryDirectory() as name:
        file = pathlib.Path(name) / "test.yaml"
        file.write_text(json.dumps({"rule_files": [str(rules)], "evaluation_interval": "15s", "tests": tests}))
        done = subprocess.run(["promtool", "test", "rules", file], capture_output=True, text=True)
    found = {alert: [] for alert in TROUBLE}
    for labels in re.findall(r"Labels:\{(.*?)\}", done.stdout + done.stderr):
        said = dict(re.findall(r'(\w+)="([^"]*)"', labels))
        found.setdefault(said["alertname"], []).append(int(said["instance"][2:4]))
    return {alert: sorted(computers) for alert, computers in found.items()}


def main():
    rules = pathlib.Path(sys.argv[1]).resolve()
    wrong = []
    for alert, computers in fired(rules).items():
        if computers != TROUBLE.get(alert):
            wrong.append(f"{alert}: fires for {computers}, and the trouble is on {TROUBLE.get(alert)}")
    named = {line.split()[-1] for line in rules.read_text().splitlines() if "- alert:" in line}
    wrong += [f"{alert}: no trouble is planted for it" for alert in sorted(named - TROUBLE.keys())]
    text = rules.read_text()
    wrong += [f"{part.split()[0]}: says no action" for part in text.split("- alert: ")[1:] if "action:" not in part]
    print("\n".join(wrong))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
