#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: no arrow of the house points back, and a namespace says where its file lies. Method: reads every #include of the project's own
headers and fails on one that the table does not allow, and on a file whose namespaces name none of its folders; then plants both, in
every spelling, and must find them. A room may use itself and what is below it.
"""
import pathlib
import posixpath
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
    "config": "executive/contract",
    "config/trouble": "executive/contract config",
    "executive/setup": "executive/contract executive/pipeline config",
    "executive/program": f"{SHARED} executive/log",
    "dds": "executive/contract config",
    "drivers/bus": "executive/contract config",
    "drivers/protocol": "executive/contract config drivers/bus",
    "drivers/guard": "executive/contract config drivers/bus",  # not drivers/protocol: it reads what those write
    "drivers/torque_output": "config drivers/bus",
    "executive/incident": "executive/contract executive/pipeline config drivers/protocol",
    "executive/runtime": f"{SHARED} executive/program executive/pipeline executive/setup executive/incident executive/trace executive/log drivers/bus drivers/protocol "
                         "drivers/guard drivers/torque_output",
    "commissioning": "executive/contract executive/pipeline executive/setup config drivers/bus drivers/protocol",  # no room that runs a robot uses it
    "policy_host": f"{SHARED} config/trouble executive/program executive/trace executive/log",
    "policy_host/remote": f"{SHARED} executive/program executive/log policy_host dds",
    "client": f"{SHARED} policy_host",
    "sensors": f"{SHARED} executive/program executive/log drivers/bus dds",
    "monitor/record": f"{SHARED} executive/incident drivers/bus drivers/protocol",
    "monitor/judge": f"{SHARED} executive/incident drivers/protocol monitor/record",
    "monitor/telemetry": f"{SHARED} executive/incident drivers/protocol monitor/record monitor/judge",
    "monitor/dds": f"{SHARED} dds executive/incident monitor/record monitor/judge",
    "monitor": f"{SHARED} executive/program executive/trace executive/log monitor/record monitor/judge monitor/telemetry monitor/dds",
    "simulation": f"{SHARED} config/trouble executive/program executive/log drivers/bus drivers/protocol client",
    "evidence/review": f"{SHARED} executive/incident executive/pipeline executive/setup monitor/record monitor/judge",
    "evidence/policy": f"{SHARED} policy_host monitor/record",
    "evidence/attestation": f"{SHARED} monitor/record monitor/judge",
    "evidence/rollout": f"{SHARED} config/trouble executive/pipeline executive/setup drivers/bus drivers/protocol drivers/guard policy_host monitor/judge simulation",
    # Nothing that runs a robot may need the lab.
    "lab/artifact": f"{SHARED} monitor/record monitor/judge evidence/review evidence/rollout",
    "lab/data_set": f"{SHARED} monitor/record lab/artifact",
    "lab/judge": f"{SHARED} executive/incident monitor/record monitor/judge evidence/attestation evidence/review evidence/rollout lab/artifact",
    "lab/panel": f"{SHARED} config/trouble executive/incident policy_host simulation monitor/record monitor/judge evidence/attestation evidence/rollout lab/artifact lab/judge",
    "lab/study": f"{SHARED} executive/pipeline executive/setup drivers/protocol simulation monitor/record monitor/judge evidence/review evidence/rollout "
                 "lab/judge lab/panel",
    "lab/trace": f"{SHARED} monitor/record monitor/judge",
    "lab/policy_trial": f"{SHARED} policy_host",
    "systemd/doctor": f"{SHARED} drivers/bus",
    "systemd/deploy": f"{SHARED} executive/incident policy_host evidence/rollout",
    "cli/run": f"{SHARED} config/trouble executive/incident cli drivers/protocol policy_host monitor/record simulation evidence/attestation",
    "cli/evidence": f"{SHARED} cli cli/run monitor/record monitor/judge evidence/review",
    "cli/lab": f"{SHARED} cli cli/run policy_host monitor/record monitor/judge evidence/attestation evidence/review evidence/rollout "
               "lab/artifact lab/data_set lab/judge lab/panel lab/policy_trial lab/study lab/trace",
    "cli/policy": f"{SHARED} cli policy_host monitor/record evidence/policy",
    "cli/top": f"{SHARED} executive/incident cli cli/run cli/evidence drivers/protocol monitor monitor/record monitor/judge monitor/telemetry",
    "cli/robot": f"{SHARED} cli cli/run commissioning drivers/bus drivers/protocol drivers/torque_output monitor/record policy_host sensors simulation systemd/deploy systemd/doctor evidence/attestation",
    "cli": f"{SHARED} executive/program",
}


TOP_ROOMS = {room.split("/")[0] for room in MAY_USE}


def room_of(path):
    names = [room for room in MAY_USE if path.startswith(room + "/")]
    return max(names, key=len, default=None)


# A header of the project's in any spelling: quotes or angles, blanks, from the root or beside the file.
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*["<]([^">]+)[">]', re.M)
NAMESPACE = re.compile(r"^(?:inline )?namespace takt([\w:]*) \{", re.M)
GENERATED_OR_C = re.compile(r"^\w+\.h$")  # ros_types.h, and client/takt's C headers, which stand in one folder where they are installed


def included(path, header):
    """The header's path from the root: one beside or above the file is found from there."""
    if header.startswith("."):
        return posixpath.normpath(posixpath.join(posixpath.dirname(path), header))
    return header


def arrows(path, text):
    """Arrows of one file that the table does not allow, as sentences."""
    room = room_of(path)
    for written in INCLUDE.findall(text):
        header = included(path, written)
        other = room_of(header)
        if room and other and other != room and other not in MAY_USE[room].split():
            yield f"{path} includes {header}: {room} may not use {other} (tests/house/arrows_test.py)"
        if room and header.startswith("tests/"):
            yield f"{path} includes {header}: the product uses no test (tests/house/arrows_test.py)"
        if room and (written.startswith(".") or ("/" not in written and written.endswith((".hpp", ".h")) and not GENERATED_OR_C.match(written))):
            yield f"{path} includes {written}: name it from the project's folder (tests/house/arrows_test.py)"
    if not room and path.split("/")[0] in TOP_ROOMS:
        yield f"{path} lies in no room of the table (tests/house/arrows_test.py)"


def misnamed(path, text):
    """What a file says of its namespace where that names none of its folders. The contract's words are `takt` itself."""
    room = room_of(path)
    named = [space.split("::")[1:] for space in NAMESPACE.findall(text)]
    if not room or room == "executive/contract" or not named:
        return
    folders = path.split("/")[:-1]
    if not any(set(words) & set(folders) for words in named):
        yield f"{path}: namespace takt::{'::'.join(named[0])} names none of its folders (tests/house/arrows_test.py)"


def main(root):
    found, files = [], 0
    for file in sorted(path for end in ("cpp", "hpp", "h") for path in root.rglob(f"*.{end}")):
        path, text = file.relative_to(root).as_posix(), file.read_text(errors="replace")
        if path.startswith(("build/", "tests/")):
            continue
        files += room_of(path) is not None
        found += [*arrows(path, text), *misnamed(path, text)]
    for sentence in found:
        print(sentence)
    planted = {"executive/pipeline/planted.cpp": ['#include "config/robot_config.hpp"', "#include <config/robot_config.hpp>", '#include "../../config/robot_config.hpp"',
                                                  '  #  include "config/robot_config.hpp"', '#include "tests/support/text.hpp"', '#include "./mode_machine.hpp"',
                                                  '#include "mode_machine.hpp"'],
               "executive/ipc/planted.h": ['#include "config/robot_config.hpp"'],
               "drivers/guard/planted.cpp": ['#include "drivers/protocol/mit/mit_codec.hpp"'],
               "executive/planted/room.cpp": [""]}
    for path, texts in planted.items():
        for text in texts:
            assert list(arrows(path, text + "\n")), f"a planted arrow was not found: {path}: {text}"
    assert list(misnamed("simulation/planted.hpp", "namespace takt::plant {\n")), "a planted namespace was not found"
    assert not list(misnamed("cli/top/planted.hpp", "namespace takt::monitor::top {\n"))
    assert files > 300, f"only {files} files were read"
    print(f"{files} files, {len(found)} arrows and namespaces that are not allowed")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(pathlib.Path(sys.argv[1]).resolve()))
