# SPDX-License-Identifier: Apache-2.0
"""The command line: python3 -m takt.lerobot."""
import argparse
import hashlib
import pathlib
import sys
from typing import Any, Dict, List, NamedTuple, NoReturn, Optional, Sequence, Tuple

import takt
from takt import _library
from takt._quantity import seconds
from takt._refused import Refused
from takt.lerobot import _act, _checkpoint, _diffusion
from takt.lerobot._checkpoint import Checkpoint
from takt.lerobot._compare import compare
from takt.lerobot._graph import Graph, Part
from takt.lerobot._robot_file import PolicySection, Term, with_policy
from takt.lerobot._units import Joint, frequency, joint, to_data, to_robot

# Of every policy's config.json: what was read elsewhere, and what says nothing about what the network computes.
_READ = ("type", "input_features", "output_features", "normalization_mapping")
_OF_TRAINING = ("device", "use_amp", "use_peft", "push_to_hub", "repo_id", "private", "tags", "license", "pretrained_path", "pretrained_revision")
_EXAMPLE = """example:
  python3 -m takt.lerobot export outputs/train/act/checkpoints/last/pretrained_model --robot arm.yaml --fps 30 --out arm_act.yaml \\
      --joint shoulder_pan=deg --joint shoulder_lift=deg --joint "gripper=0..100 is -10..95 deg"

  python3 -m takt.lerobot compare FOLDER runs/newest --joint ...     # the same --joint, where LeRobot and PyTorch are

exit codes: 0 written, or the run agrees; 1 the files cannot be written or exist, or the run differs; 64 command line; 65 the folder, the robot file or the run, with
the reason."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise Refused(f"{self.prog}: {message}", _library.USAGE)


def _account(checkpoint: Checkpoint, used: Sequence[str], of_training: Sequence[str], ignored: Sequence[str]) -> None:
    """Every key of config.json is used, lost in one line, or refused."""
    lost = [key for key in checkpoint.config if key in of_training or key in _OF_TRAINING or key in ignored]
    for key, value in checkpoint.config.items():
        if key in lost or key in used or key in _READ:
            continue
        if value not in (None, False, [], {}, ""):
            raise Refused(f"{checkpoint.folder}/config.json: {_checkpoint.shown(key)} is {_checkpoint.shown(value)}, and no such key is known here; "
                          f"if it does not change what the network computes, add --ignore {_checkpoint.shown(key)}")
        lost.append(key)
    if lost:
        checkpoint.lost.append(f"config.json: not carried, of training or without effect: {', '.join(sorted(map(_checkpoint.shown, lost)))}")


def _with_units(checkpoint: Checkpoint, joints: List[Joint]) -> None:
    state = [one for one in checkpoint.inputs if one.kind == "STATE"]
    for feature in (*state, checkpoint.action):
        if feature.shape[0] != len(joints):
            raise Refused(f"{checkpoint.folder}/config.json: {feature.name} has {feature.shape[0]} values, and {len(joints)} --joint say what they are; name one "
                          "joint and its unit for each, in the data set's order (`names` in its meta/info.json). What is no joint's position cannot be exported")
    for one in state:
        checkpoint.normal[one.name] = checkpoint.normal[one.name].after(to_data(joints))
    checkpoint.normal["action"] = to_robot(joints).after(checkpoint.normal["action"])


def _sensor_of(checkpoint: Checkpoint, feature: str) -> str:
    return checkpoint.recorded.get(feature, feature).rpartition(".")[2]


def _terms(checkpoint: Checkpoint) -> List[Term]:
    history = checkpoint.integer("n_obs_steps", 1, 64)
    terms = [Term(one.name, history=history) for one in checkpoint.of_kind("STATE")]
    for one in checkpoint.of_kind("ENV"):
        terms.append(Term(one.name, _sensor_of(checkpoint, one.name), values=one.shape[0], history=history))
    for one in checkpoint.of_kind("VISUAL"):
        terms.append(Term(one.name, _sensor_of(checkpoint, one.name), (one.shape[1], one.shape[2]), history=history))
    sensors = [one.sensor for one in terms if one.sensor]
    if len(set(sensors)) < len(sensors):
        raise Refused(f"{checkpoint.folder}/config.json: two features end in the same word ({', '.join(sensors)}), which names their sensors; rename one")
    return terms


def _period(options: argparse.Namespace, checkpoint: Checkpoint, rate: float, steps: int) -> Tuple[str, str]:
    """Of an inference, and why."""
    if options.period:
        seconds(options.period, "--period")
        checkpoint.lost.append(f"config.json: n_action_steps {checkpoint.integer('n_action_steps', 1, steps)}: --period says how often to infer")
        return str(options.period), "--period"
    played = checkpoint.integer("n_action_steps", 1, steps)
    if checkpoint.config.get("n_obs_steps") != 1:
        played, why = 1, "as far apart as its history's instants were in training"
    elif played >= steps:
        raise Refused(f"{checkpoint.folder}/config.json: n_action_steps {played} is the whole chunk: LeRobot stands still while it infers. Say by --period how often "
                      f"to infer, less than {1000 * steps / rate:.0f} ms, for example --period \"{500 * steps / rate:.0f} ms\"")
    else:
        why = f"n_action_steps {played} at {rate:g} Hz"
    return f"{max(1, round(1000 * played / rate))} ms", why + ", in whole ms"


class _Network(NamedTuple):
    checkpoint: Checkpoint
    joints: List[Joint]
    terms: List[Term]
    steps: int
    file: List[Part]


def _network(options: argparse.Namespace) -> _Network:
    """The ONNX file of a folder: a function of the folder and of --joint, --ddim and --ignore."""
    joints = [joint(text) for text in options.joint]
    checkpoint = _checkpoint.read(pathlib.Path(options.folder))
    diffuses = checkpoint.kind == "diffusion"
    if options.ddim and not diffuses:
        raise Refused(f"--ddim {options.ddim} is for diffusion policies, and {options.folder} is one of {checkpoint.kind}", _library.USAGE)
    network: Any = _diffusion if diffuses else _act
    _account(checkpoint, network.USED, network.OF_TRAINING, options.ignore)
    _with_units(checkpoint, joints)
    graph, terms = Graph(), _terms(checkpoint)
    steps = _diffusion.build(graph, checkpoint, options.ddim) if diffuses else _act.build(graph, checkpoint)
    checkpoint.weights.refuse_rest()
    about = {"lerobot_policy": checkpoint.kind, "lerobot_weights_sha256": checkpoint.sha256, "lerobot_joints": "; ".join(options.joint)}
    return _Network(checkpoint, joints, terms, steps, graph.file(about))


def _export(options: argparse.Namespace) -> int:
    rate, step_period = frequency(options.fps)
    out, robot = pathlib.Path(options.out), pathlib.Path(options.robot)
    network_file = out.with_suffix(".onnx")
    for path in (out, network_file):
        if path.exists():
            raise Refused(f"{path} exists already; choose another --out", 1)
    network = _network(options)
    checkpoint, diffuses = network.checkpoint, network.checkpoint.kind == "diffusion"
    period, why = _period(options, checkpoint, rate, network.steps)
    section = PolicySection(network_file.name, period, step_period, network.steps, "velocity" if diffuses else "action", network.joints, network.terms)
    if diffuses:
        gain, shift = checkpoint.normal["action"]
        section.sampler, section.scale = "noisy: x_t, time: t, steps: 1", "[" + ", ".join(f"{one:.9g}" for one in gain) + "]"
        section.offset = "[" + ", ".join(f"{one:.9g} rad" for one in shift) + "]"
        checkpoint.lost.append(f"noise: Takt draws its own, by policy.sampler.seed; the network denoises it by DDIM in {checkpoint.config['num_inference_steps']} steps")
    coefficient = checkpoint.config.get("temporal_ensemble_coeff")
    if coefficient is not None:
        section.join = f"kind: ensemble, decay: {checkpoint.number('temporal_ensemble_coeff', 0, 10):g}"
    text, added = with_policy(robot, section, f"{max(50, round(3000 / rate))} ms")
    _write({network_file: network.file, out: [text.encode()]})
    _say(checkpoint, section, why, added, out, robot)
    return 0


def _compare_with(options: argparse.Namespace) -> int:
    run = takt.open(options.run)
    if not isinstance(run, takt.Run):
        raise Refused(f"{options.run} is a panel's artifact; name a run folder")
    if not 1 <= options.answers <= 100000 or not options.tolerance > 0:
        raise Refused("--answers is from 1 to 100000, and --tolerance more than 0", _library.USAGE)
    network = _network(options)
    policy: Any = run.manifest.get("policy")
    ours = hashlib.sha256()
    for part in network.file:
        ours.update(part)
    if not isinstance(policy, dict) or policy.get("sha256") != ours.hexdigest():
        print(f"note: {options.run} ran another file than `export` writes of {options.folder} here, with these --joint")
    found = compare(network.checkpoint, network.joints, run, lambda feature: _sensor_of(network.checkpoint, feature), options.answers)
    agrees = found.largest <= options.tolerance
    print(f"{'agrees' if agrees else 'differs'}: {found.compared} of {found.answers} answers of {options.run}: largest difference {found.largest:.1e} rad (slide: m), "
          f"of joint {found.joint} at step {found.step} of answer {found.answer}; tolerance {options.tolerance:g}")
    return 0 if agrees else 1


def _write(files: Dict[pathlib.Path, List[Part]]) -> None:
    """All of them, or none."""
    written: List[pathlib.Path] = []
    try:
        for path, parts in files.items():
            with open(path, "xb") as file:
                written.append(path)
                file.writelines(parts)
    except OSError as error:
        for path in written:
            path.unlink(missing_ok=True)
        raise Refused(f"{error.filename or list(files)[len(written) - 1]} cannot be written: {error.strerror}", 1) from None


def _say(checkpoint: Checkpoint, section: PolicySection, why: str, added: List[str], out: pathlib.Path, robot: pathlib.Path) -> None:
    print(f"{out}: {robot} with {checkpoint.kind} as its policy, {section.file}: {section.steps} steps of {len(section.joints)} joints")
    print(f"policy.step_period {section.step_period}; policy.period {section.period} ({why})")
    for one in section.joints:
        print(f"joint {one.name}: {one.gain:.6g} x the data set's value {'+' if one.shift >= 0 else '-'} {abs(one.shift):.6g}, rad (slide: m)")
    for term in section.terms:
        if term.sensor in added:
            what = f"RGB images of {term.image[0]} x {term.image[1]}" if term.image[0] else f"{term.values} values, in the data set's units"
            print(f"sensor {term.sensor} added: {what}, of {term.tensor}; its timeout is a choice of this command: set it")
    for line in checkpoint.lost:
        print(f"lost: {line}")
    print(f"next: takt config check {out}; takt policy check {out.with_suffix('.onnx')} --robot {out}")


def main(arguments: Optional[List[str]] = None) -> int:
    plain = argparse.RawDescriptionHelpFormatter
    parser = _Parser(prog="python3 -m takt.lerobot", description="Checkpoint folders of LeRobot (ACT, diffusion) as policies of robot files.", epilog=_EXAMPLE, formatter_class=plain,
                     allow_abbrev=False)
    commands: Any = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    export = commands.add_parser("export", help="write the ONNX file, and the robot file that uses it", allow_abbrev=False, epilog=_EXAMPLE, formatter_class=plain)
    other = commands.add_parser("compare", help="show a run's observations to LeRobot's own policy, and compare its answers with the run's", allow_abbrev=False, epilog=_EXAMPLE,
                                formatter_class=plain)
    for command in (export, other):
        command.add_argument("folder", metavar="FOLDER", help="config.json, model.safetensors, and the processors' files of newer LeRobot")
    export.add_argument("--robot", metavar="FILE", required=True, help="robot file whose policy is replaced; it is not changed")
    export.add_argument("--out", metavar="FILE", required=True, help="robot file to write; the network beside it, .onnx; neither may exist")
    export.add_argument("--fps", metavar="HZ", required=True, help="frames per second of the data set: the time between two steps of a chunk")
    export.add_argument("--period", metavar="TIME", help="time between two inferences (\"200 ms\"); default: n_action_steps of config.json")
    other.add_argument("run", metavar="RUN", help="run folder, with record.policy_inputs and record.images")
    other.add_argument("--answers", metavar="COUNT", type=int, default=20, help="answers to compare, spread over the run (20)")
    other.add_argument("--tolerance", metavar="RAD", type=float, default=1e-4, help="largest difference of a target, rad or m (0.0001)")
    for command in (export, other):
        command.add_argument("--joint", metavar="NAME=UNIT", action="append", required=True,
                             help="joint of the robot file and unit of each value of observation.state and action, in their order: rad, deg, m, mm, "
                                  "or a range such as \"0..100 is -10..95 deg\"")
        command.add_argument("--ddim", metavar="STEPS", type=int, default=0, help="diffusion: denoise by DDIM in so many steps; default: as config.json says, where that is DDIM")
        command.add_argument("--ignore", metavar="KEY", action="append", default=[], help="key of config.json that is unknown here and does not matter")
    options = parser.parse_args(arguments)
    return _export(options) if options.command == "export" else _compare_with(options)


if __name__ == "__main__":
    # Refusals are one line and an exit code (takt._refused).
    sys.exit(main())
