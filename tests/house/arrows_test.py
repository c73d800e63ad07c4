#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: no arrow of the house points back. Method: reads every #include of the project's own headers and fails on one that the
table does not allow; then plants an include that is not allowed and must find it. A room may use itself and what is below it.
"""
import pathlib
import re
import sys

SHARED = "executive/contract executive/ipc config"  # the words, the segments, the robot files
# Room: what it may include. The longest name that fits a file is its room. Rooms stand below those that use them.
MAY_USE = {
    "executive/contract": "",
    "executive/trace": "executive/contract",
    "executive/log": "",
    "executive/ipc": "executive/contract",
    "executive/pipeline": "executive/contract",
    "executive/hazards": "executive/contract executive/pipeline",
    "config": "executive/contract",
    "executive/setup": "executive/contract executive/pipeline config",
    "executive/program": f"{SHARED} executive/log",
    "dds": "executive/contract config",
    "drivers/bus": "executive/contract config",
    "drivers/protocol": "executive/contract config drivers/bus",
    "drivers/guard": "executive/contract config drivers/bus",  # not drivers/protocol: it reads what those write
    "drivers/torque_output": "config drivers/bus",
    "drivers/tools": "executive/contract config drivers/bus drivers/protocol",
    "executive/incident": "executive/contract executive/pipeline config drivers/protocol",
    "executive/runtime": f"{SHARED} executive/program executive/pipeline executive/setup executive/incident executive/trace executive/log drivers/bus drivers/protocol "
                         "drivers/guard drivers/torque_output",
    "policy_host": f"{SHARED} executive/program executive/trace executive/log",
    "policy_host/remote": f"{SHARED} executive/program executive/log policy_host dds",
    "client": f"{SHARED} policy_host",
    "sensors": f"{SHARED} executive/program executive/log drivers/bus dds",
    "monitor/record": f"{SHARED} executive/incident drivers/bus drivers/protocol",
    "monitor/judge": f"{SHARED} executive/incident drivers/protocol monitor/record",
    "monitor/telemetry": f"{SHARED} executive/incident drivers/protocol monitor/record monitor/judge",
    "monitor/dds": f"{SHARED} dds executive/incident monitor/record monitor/judge",
    "monitor": f"{SHARED} executive/program executive/trace executive/log monitor/record monitor/judge monitor/telemetry monitor/dds",
    "simulation": f"{SHARED} executive/program executive/log drivers/bus drivers/protocol client",
    "evidence/review": f"{SHARED} executive/incident executive/pipeline executive/setup monitor/record monitor/judge",
    "evidence/policy": f"{SHARED} policy_host monitor/record",
    "evidence/attestation": f"{SHARED} monitor/record monitor/judge",
    "evidence/rollout": f"{SHARED} executive/pipeline executive/setup drivers/bus drivers/protocol drivers/guard policy_host monitor/judge simulation",
    # Nothing that runs a robot may need the lab.
    "lab/artifact": f"{SHARED} monitor/record monitor/judge evidence/review evidence/rollout",
    "lab/data_set": f"{SHARED} monitor/record lab/artifact",
    "lab/judge": f"{SHARED} executive/incident monitor/record monitor/judge evidence/attestation evidence/review evidence/rollout lab/artifact",
    "lab/panel": f"{SHARED} executive/incident policy_host simulation monitor/record monitor/judge evidence/attestation evidence/rollout lab/artifact lab/judge",
    "lab/study": f"{SHARED} executive/pipeline executive/setup drivers/protocol simulation monitor/record monitor/judge evidence/review evidence/rollout "
                 "lab/judge lab/panel",
    "lab/trace": f"{SHARED} monitor/record monitor/judge",
    "lab/policy_trial": f"{SHARED} policy_host",
    "systemd/doctor": f"{SHARED} drivers/bus",
    "systemd/deploy": f"{SHARED} executive/incident policy_host evidence/rollout",
    "cli/run": f"{SHARED} executive/incident cli drivers/protocol policy_host monitor/record simulation evidence/attestation",
    "cli/evidence": f"{SHARED} cli cli/run monitor/record monitor/judge evidence/review",
    "cli/lab": f"{SHARED} cli cli/run policy_host monitor/record monitor/judge evidence/attestation evidence/review evidence/rollout "
               "lab/artifact lab/data_set lab/judge lab/panel lab/policy_trial lab/study lab/trace",
    "cli/policy": f"{SHARED} cli policy_host monitor/record evidence/policy",
    "cli/top": f"{SHARED} executive/incident cli cli/run cli/evidence drivers/protocol monitor monitor/record monitor/judge monitor/telemetry",
    "cli/robot": f"{SHARED} executive/setup cli cli/run drivers/bus drivers/protocol drivers/tools drivers/torque_output monitor/record policy_host sensors simulation systemd/deploy systemd/doctor evidence/attestation",
    "cli": f"{SHARED} executive/program",
}


TOP_ROOMS = {room.split("/")[0] for room in MAY_USE}


def room_of(path):
    names = [room for room in MAY_USE if path.startswith(room + "/")]
    return max(names, key=len, default=None)


def arrows(path, text):
    """Arrows of one file that the table does not allow, as sentences."""
    room = room_of(path)
    for header in re.findall(r'^#include "([^"]+)"', text, re.M):
        other = room_of(header)
        if room and other and other != room and other not in MAY_USE[room].split():
            yield f"{path} includes {header}: {room} may not use {other} (tests/house/arrows_test.py)"
    if not room and path.split("/")[0] in TOP_ROOMS:
        yield f"{path} lies in no room of the table (tests/house/arrows_test.py)"


def main(root):
    found, files = [], 0
    for file in sorted(root.rglob("*.[ch]pp")):
        path = file.relative_to(root).as_posix()
        files += room_of(path) is not None
        found += arrows(path, file.read_text())
    for sentence in found:
        print(sentence)
    planted = list(arrows("executive/pipeline/planted.cpp", '#include "config/robot_config.hpp"\n'))
    planted_room = list(arrows("executive/planted/room.cpp", ""))
    assert planted_room, "a room without a row was not found"
    planted_guard = list(arrows("drivers/guard/planted.cpp", '#include "drivers/protocol/mit/mit_codec.hpp"\n'))
    assert planted and planted_guard, "a planted arrow was not found"
    assert files > 300, f"only {files} files were read"
    print(f"{files} files, {len(found)} arrows that are not allowed")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1]).resolve()))
