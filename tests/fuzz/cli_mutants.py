#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: whatever a stranger wrote, and whatever a person typed, `takt` ends with a documented exit code, in 10 s of processor time, in 1 GiB, and prints nothing that
a terminal obeys. Method: sound files and options, each with a few changes drawn by the seed (bits, numbers, lines, pieces of others); each call under limits.
Usage: cli_mutants.py SOURCE_DIR BIN_DIR [--models] [--count N] [--seed S] [--only INDEX] [--workers N]. Mutant INDEX of a seed is the same every time; --only keeps
its folder. --models: models alone (URDF, MJCF, xacro), by config new, import and check. Exit codes: 0 no finding, 1 findings, each with its command.
"""
import argparse
import concurrent.futures
import os
import pathlib
import random
import re
import resource
import shutil
import subprocess
import sys
import tempfile

LONGEST_S, PATIENCE_S, MOST_BYTES = 10, 120, 1 << 30  # of processor time; of waiting, on a machine that stalls
EXIT_CODES = {0, 1, 2, 3, 4, 64, 65, 69, 71}
OBEYED = re.compile(rb"[\x00-\x08\x0b-\x1f\x7f]|\xc2[\x80-\x9f]")
WORDS = [b"", b"-1", b"0", b"1e999", b"nan", b"inf", b"-0", b"1e-320", b"18446744073709551616", b"9223372036854775807", b"2147483648", b"0x10", b"010", b"~", b"null",
         b"true", b"[]", b"{}", b"[", b"}", b"\"", b"'", b":", b"- ", b"%", b"{0}", b"\x1b[2J", b"\xc2\x9b", b"\xff", b"\x00", b"\xe2\x80\xae", b"A" * 300, b"[" * 300,
         b"1 ms", b"1e18 s", b"-5 rad", b"1 Nm", b"/dev/zero", b"/dev/full", b".", b"..", b"--json", b"-", b"--", b"&a", b"*a", b"!!binary", b"<<", b"<!--", b"&lt;"]
NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
DEPLOY = """{joint_ids_map: [1, 0], step_dt: 0.02, stiffness: [100.0, 40.0], damping: [2.0, 1.0], default_joint_pos: [-0.5, 0.3],
commands: { base_velocity: { ranges: { lin_vel_x: [-0.5, 1.0], ang_vel_z: [0.1, 0.2] } } },
actions: { JointPositionAction: { clip: null, scale: [0.25, 0.5], offset: [-0.5, 0.3], joint_ids: null } },
observations: { base_ang_vel: { params: {}, clip: null, scale: [0.2, 0.2, 0.2], history_length: 5 },
  velocity_commands: { params: {}, clip: [-1, 1], scale: [1.0, 2.0], history_length: 5 },
  joint_pos_rel: { params: {}, clip: null, scale: [1.0, 1.0], history_length: 5 } } }
"""
BUNDLE = """models: {walk: {parameters: {model_path: arm6_reach.onnx, sha256sum: abc, backend: onnx, opset_version: 20},
  inputs: [{name: obs, dtype: float32, shape: [1, 4], type: tensor, kind: state/body/rotation, element_names: [[qx, qy, qz, qw]]}],
  outputs: [{name: target, dtype: float32, shape: [1, 2], type: tensor, kind: target/joint/position, element_names: [[a, b]]}]}}
pipeline: {data_flow: {}, inputs: {walk: [obs]}, outputs: {walk: [target]}, configs: {frequency: 50.0}}
system information: {leapp config version: '1.1'}
"""
URDF = """<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><link name="base"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>
</inertial><visual><geometry><mesh filename="package://r/meshes/base.stl"/></geometry></visual></link><link name="tip"><inertial><origin xyz="0 0 0.1" rpy="0 0 0"/>
<mass value="0.5"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link><link name="finger"><inertial><mass value="0.1"/>
<inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
<joint name="a/b:c d" type="revolute"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="3"/></joint>
<joint name="slide" type="prismatic"><parent link="tip"/><child link="finger"/><axis xyz="1 0 0"/><mimic joint="a/b:c d" multiplier="0.1" offset="0"/>
<limit lower="0" upper="0.04" effort="5" velocity="0.1"/></joint></robot>
"""
XACRO = """<robot name="r" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:property name="m" value="${1 + 2}"/><xacro:macro name="l" params="n"><link name="${n}"/></xacro:macro>
<xacro:l n="base"/></robot>
"""
NEWER = """<mujoco><option ls_iterations="5"><flag eulerdamp="disable"/></option><asset><mesh name="m" file="m.obj" maxhullvert="32" content_type="model/obj"/></asset>
<default><default class="c"><joint damping="1" actuatorfrcrange="-5 5"/></default></default><worldbody><frame pos="0 0 1"><body name="b" gravcomp="1"><freejoint/>
<geom type="sphere" size="0.1"/><body name="l"><joint name="j" class="c" axis="0 0 1" range="-1 1"/><geom type="capsule" size="0.05" fromto="0 0 0 0 0 1"/></body></body>
</frame></worldbody><equality><joint joint1="j" polycoef="0 1 0 0 0"/></equality><actuator><position name="p" joint="j" kp="5" kv="1" inheritrange="1"/></actuator>
<sensor><gyro name="g" site="s"/></sensor></mujoco>
"""
IMPORT = ["config", "import", "FILE", "--policy", "arm6_reach.onnx", "--robot", "r", "-o", "out.yaml"]
NEW = ["config", "new", "FILE", "--simulated", "-o", "out.yaml"]


def model_cases(source):
    config = source / "config"
    models = [config / "balancer.xml", *sorted((source / "tests/cli/robots").glob("*")), *sorted((source / "tests/evidence/rollout").glob("*.xml"))]
    commands = [NEW, NEW[:3] + NEW[4:], ["config", "import", "arm6_reach.onnx", "--model", "FILE", "--robot", "r", "-o", "out.yaml"], [*NEW, "--mesh-path", "."]]
    return [(models, config, commands), ([URDF, XACRO, NEWER], config, commands), ([config / "balancer.xml"], config, [["config", "check", "balancer.yaml"]])]


def cases(source):
    """(sound files of which one is changed, what must lie beside it, commands)."""
    config, release = source / "config", source / "tests/releases/0.2.0"
    robots = [path for path in sorted(config.glob("*.yaml")) if b"schema: takt.robot/1" in path.read_bytes()]
    return [
        (robots, config, [["config", "check", "FILE", "--json"], ["config", "check", "FILE"], ["config", "show", "FILE"], ["budget", "FILE"]]),
        ([DEPLOY, BUNDLE], config, [IMPORT, [*IMPORT, "--model", "balancer.xml", "--simulated"], ["policy", "check", "FILE"]]),
        *model_cases(source),
        (sorted(config.glob("*.onnx")), config, [["policy", "check", "FILE"], ["policy", "check", "FILE", "--robot", "arm6.yaml"]]),
        (sorted((release / "run").iterdir()), release / "run", [[*words, "."] for words in (
            ["report"], ["report", "--json"], ["replay"], ["audit"], ["policy", "replay"], ["budget"], ["runs", "list"], ["export", "lerobot", "--out", "out"])]),
        (sorted((release / "artifact").iterdir()), release / "artifact", [
            ["audit", "."], ["audit", ".", "--json"], ["audit", ".", "--draft"], ["panel", "merge", "out", "."],
            ["compare", ".", "--method-a", "method-a", "--method-b", "method-b", "--rows"]]),
        (["".join(f"{age}\n" for age in range(1, 300))], config, [["ages", "FILE", "--max-age", "100ms"], ["ages", "FILE", "--max-age", "0.1s", "--json"]]),
    ]


def change(content, other, draw):
    at = draw.randrange(len(content) + 1)
    end = min(len(content), at + draw.choice([1, 1, 4, 16, 64, 1000]))
    kind = draw.randrange(8)
    if kind == 0 and at < len(content):
        return content[:at] + bytes([content[at] ^ 1 << draw.randrange(8)]) + content[at + 1:]
    if kind == 1:
        return content[:at] + content[end:]
    if kind == 2:
        return content[:at] + content[at:end] * draw.choice([2, 3, 50]) + content[end:]
    if kind == 3:
        return content[:at] + draw.choice(WORDS) + content[end if draw.random() < 0.5 else at:]
    if kind == 4 and (numbers := list(NUMBER.finditer(content[:200_000]))):
        number = draw.choice(numbers)
        return content[:number.start()] + draw.choice(WORDS) + content[number.end():]
    if kind == 5:
        lines = content.split(b"\n")
        return b"\n".join(draw.choice(other.split(b"\n")) if line == draw.randrange(len(lines)) else one for line, one in enumerate(lines))
    if kind == 6:
        begin = draw.randrange(len(other) + 1)
        return content[:at] + other[begin:begin + draw.choice([8, 64, 4000])] + content[end:]
    return content[:at] if draw.random() < 0.2 else content[:at] + bytes(draw.randrange(256) for _ in range(4)) + content[end:]


def changed_words(words, draw):
    kind, at = draw.randrange(4), draw.randrange(2, len(words) + 1)
    word = draw.choice(WORDS).replace(b"\x00", b"").decode("utf-8", "surrogateescape")
    if kind < 2:
        return words[:at] + [word] + words[at + kind:]
    return words[:at] + words[at + 1:] if kind == 2 else words + words[min(at, len(words) - 1):]


def limits():
    for what, most in ((resource.RLIMIT_AS, MOST_BYTES), (resource.RLIMIT_FSIZE, MOST_BYTES), (resource.RLIMIT_CORE, 0), (resource.RLIMIT_CPU, LONGEST_S)):
        resource.setrlimit(what, (most, most))


def finding(command, folder):
    try:
        done = subprocess.run(command, cwd=folder, preexec_fn=limits, stdin=subprocess.DEVNULL, capture_output=True, timeout=PATIENCE_S, check=False)
    except subprocess.TimeoutExpired:
        return f"does not end within {PATIENCE_S} s"
    said = done.stdout + done.stderr
    if done.returncode not in EXIT_CODES:
        return f"ends with {done.returncode}: {said[-300:]!r}"
    obeyed = OBEYED.search(said)
    return f"prints what a terminal obeys: {said[max(0, obeyed.start() - 100):obeyed.end() + 60]!r}" if obeyed else None


def linked(source, target):
    """Of 3 MiB beside a mutant all but one file stay as they are: a copy of them takes longer than the command. Behind the links are
    copies, so that nothing can write into the repository."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copy2(source, target)


def try_mutant(arguments, folder, index):
    draw = random.Random(f"{arguments.seed}/{index}")
    files, beside, commands = draw.choice((model_cases if arguments.models else cases)(arguments.source))
    sound, words = draw.choice(files), list(draw.choice(commands))
    content, other = ((one.encode() if isinstance(one, str) else one.read_bytes()) for one in (sound, draw.choice(files)))
    shutil.copytree(arguments.copies[beside], folder, copy_function=linked)
    changes_words = draw.random() < 0.15
    for _ in range(0 if changes_words else draw.choice([1, 1, 1, 2, 4, 8])):
        content = change(content, other, draw)
    name = "mutant" + ((".xml" if sound.startswith("<") else ".yaml") if isinstance(sound, str) else sound.suffix) if "FILE" in words else sound.name
    (folder / name).unlink(missing_ok=True)  # the link, and not the sound file behind it
    (folder / name).write_bytes(content)
    words = [name if word == "FILE" else word for word in words]
    if changes_words:
        words = changed_words(words, draw)
    wrong = finding([arguments.bin / "takt", *words], folder)
    if arguments.only is None:
        shutil.rmtree(folder)
    return wrong and f"mutant {index} (--seed {arguments.seed} --only {index}): takt {' '.join(words)!r} with {name}: {wrong}"


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    for name in ("source", "bin"):
        parser.add_argument(name, type=lambda path: pathlib.Path(path).resolve())
    for name, default in (("count", 100), ("seed", 1), ("only", None), ("workers", 2)):
        parser.add_argument(f"--{name}", type=int, default=default)
    parser.add_argument("--models", action="store_true")
    arguments = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="takt-mutants-"))
    arguments.copies = {}
    for _, beside, _ in (model_cases if arguments.models else cases)(arguments.source):
        if beside not in arguments.copies:
            arguments.copies[beside] = shutil.copytree(beside, folder / f"copy-{len(arguments.copies)}", ignore=shutil.ignore_patterns("grafana", "*.hpp", "*.cpp"))
    indices = range(arguments.count) if arguments.only is None else [arguments.only]
    with concurrent.futures.ThreadPoolExecutor(arguments.workers) as pool:
        wrong = filter(None, pool.map(lambda index: try_mutant(arguments, folder / str(index), index), indices))
        findings = sum(print(one, flush=True) is None for one in wrong)
    print(f"{len(indices)} mutants, {findings} findings", *([] if arguments.only is None else [folder]), sep="\n")
    if arguments.only is None:
        shutil.rmtree(folder, ignore_errors=True)
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
