#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the drive sheets are right, what is made of them is not older than they are, and where sources conflict there is
no value. Method: commands that others published are taken apart here, by arithmetic of this file alone, with the
sheets' ranges; numbers are typed here from the makers' papers; the generator is run with --check; sheets with one
mistake each are refused. Usage: drive_sheets_test.py ROOT. Exit codes: 0 fine, 1 not, 77 PyYAML is not installed.
"""
import math
import pathlib
import subprocess
import sys
import tempfile

try:
    import yaml  # noqa: F401
except ImportError:
    print("SKIPPED: python3-yaml is not installed", file=sys.stderr)
    sys.exit(77)

# Published commands of the MIT protocol (bgkatz/motorcontrol's packing p16 v12 kp12 kd12 t12, big-endian): what was
# asked for, and the bytes. AK10-9 and DM4310.
COMMANDS = {
    "AK10-9": ((1.0, -2.0, 100, 1.5, 3.0), "8a3c7ad3334cc85e"),
    "DM4310": ((0.5, 1.0, 20, 0.5, -2.0), "851e8430a3199666"),
}
# Typed from the papers: velocity rad/s, torque Nm, kp Nm/rad, kd Nm s/rad. RobStride's manuals of RS00 (types 1 and 2),
# RS03 (4.1.2, revisions 251112, 260112, 260713), RS06 (as a driver quotes it); cybergear-docs instructionmanual.md,
# section 4; Damiao's table in openarm_can's dm_motor_constants.hpp; CubeMars' AK Series Actuator Driver Manual V1.0.8, 5.3.
PAPERS = {
    "RS00": (33, 14, 500, 5),
    "RS03": (20, 60, 5000, 100),
    "RS06": (50, 36, 5000, 100),
    "CyberGear": (30, 12, 500, 5),
    "DM4310": (30, 10, 500, 5),
    "DM4340_48V": (10, 28, 500, 5),
    "DM8006": (45, 40, 500, 5),
    "AK10-9": (50, 65, 500, 5),
    "AK80-64": (8, 144, 500, 5),
    "DM6006": (45, 20, 500, 5),
    "DM8009": (45, 54, 500, 5),
}
# Sources disagree, or there is one alone: nothing may be chosen.
def alone(velocity, torque, kp, kd, position="12.5664"):
    return (["position_range", "velocity_range", "torque_range", "kp_range", "kd_range"],
            f"{position} rad, one source; {velocity} rad/s, one source; {torque} Nm, one source; {kp} Nm/rad, one source; "
            f"{kd} Nm s/rad, one source")


CONFLICTS = {"AK60-6": (["velocity_range"], "45 or 50 rad/s"), "AK80-9": (["velocity_range"], "22.5 or 25.64 or 50 rad/s"),
             "AK80-6": (["velocity_range"], "22.5 or 38.2 or 76 rad/s"), "RS05": (["torque_range"], "5.5 or 6 Nm"),
             "AK70-10": (["torque_range"], "24 or 25 Nm"), "DM4340": (["velocity_range"], "8 or 10 rad/s"),
             "DM3507": (["velocity_range", "torque_range"], "30 or 50 rad/s; 5 or 10 Nm"),
             "DM6248P": (["position_range"], "12.5 or 12.566 rad"), "DM4310P": alone(50, 10, 500, 5, "12.5"),
             "DMJH11": alone(10, 12, 500, 5, "12.5"), "DM10422P": alone(20, 500, 500, 5, "12.566"),
             "RS01": alone(44, 17, 500, 5), "RS02": alone(44, 17, 500, 5), "RS04": alone(15, 120, 5000, 100)}

SHEET = """model: {model}
maker: T-Motor
protocol: mit
variant: tmotor
sources:
  - where: "a paper"
    kind: {first}
    position_range: 12.5
    velocity_range: {velocity}
    torque_range: 18
    kp_range: 500
    kd_range: 5
  - where: "a shop"
    kind: {kind}
    velocity_range: 45
"""


def expect(what, condition):
    if not condition:
        print(f"FAILED: {what}", file=sys.stderr)
    return bool(condition)


def taken_apart(text, ranges):
    code = int(text, 16)
    position, velocity, torque, kp, kd = ranges
    fields = []
    for bits, low, high in ((12, -torque, torque), (12, 0, kd), (12, 0, kp), (12, -velocity, velocity),
                            (16, -position, position)):
        fields.append((low + (code & (1 << bits) - 1) * (high - low) / ((1 << bits) - 1), (high - low) / ((1 << bits) - 1)))
        code >>= bits
    torque, kd, kp, velocity, position = fields
    return position, velocity, kp, kd, torque


def check_sheets(presets, sheets):
    fine = True
    by_model = {sheet.model: sheet for sheet in sheets}

    def settled(model):
        return [presets.number(value) if value is not None else None
                for value in (by_model[model].settled(name) for name in presets.RANGES)]

    for model, (asked, text) in COMMANDS.items():
        for wanted, (found, step) in zip(asked, taken_apart(text, settled(model))):
            fine &= expect(f"{model}: {text} asks for {wanted}, by the sheet for {found:.4f}",
                           -0.001 * step <= wanted - found <= 1.001 * step)
    for model, numbers in PAPERS.items():
        fine &= expect(f"{model} is {settled(model)[1:]}, the papers say {numbers}", tuple(settled(model)[1:]) == numbers)
    for sheet in sheets:
        position = settled(sheet.model)[0]
        wanted = 12.5 if sheet.protocol == "mit" else 4 * math.pi
        fine &= expect(f"{sheet.model} spans {position} rad", position is None or math.isclose(position, wanted))
        unsettled = [name for name in presets.RANGES if sheet.settled(name) is None]
        conflict = CONFLICTS.get(sheet.model)
        fine &= expect(f"{sheet.model} leaves {unsettled} open", unsettled == (conflict[0] if conflict else []))
        fine &= expect(f"{sheet.model} says `{sheet.unsettled()}`", sheet.unsettled() == (conflict[1] if conflict else ""))
    return fine


def check_rules(presets):
    """One sheet each, with one thing changed."""
    fine = True
    with tempfile.TemporaryDirectory() as folder:
        def sheet(**changes):
            values = {"model": "X1", "velocity": 50, "first": "manual", "kind": "seller", **changes}
            path = pathlib.Path(folder) / "X1.yaml"
            path.write_text(SHEET.format(**values))
            return presets.read(path)

        def refused(**changes):
            try:
                sheet(**changes)
            except presets.WrongSheet as wrong:
                return "X1.yaml: " in str(wrong)
            return False

        fine &= expect("a seller's table yields to a manual", sheet().settled("velocity_range") == 50)
        fine &= expect("code alone is no value", sheet(first="code").settled("velocity_range") is None)
        fine &= expect("nor with a seller's table that agrees",
                       sheet(first="code", velocity=45).settled("velocity_range") is None)
        fine &= expect("two that agree are", sheet(first="code", kind="bench", velocity=45).settled("velocity_range") == 45)
        fine &= expect("code does not", sheet(kind="code").settled("velocity_range") is None)
        fine &= expect("what agrees to half a percent agrees",
                       sheet(kind="bench", velocity=45.2).settled("velocity_range") == 45.2)
        fine &= expect("and no further", sheet(kind="bench", velocity=45.3).settled("velocity_range") is None)
        for what, changes in (("another model's name", {"model": "X2"}), ("a kind nobody knows", {"kind": "rumour"}),
                              ("no number", {"velocity": "fast"}), ("a negative range", {"velocity": -50}),
                              ("a truth value", {"velocity": "true"}), ("no YAML", {"velocity": "[1"})):
            fine &= expect(f"{what} is refused", refused(**changes))
    return fine


def main(root):
    sys.path.insert(0, str(pathlib.Path(root) / "config/drives"))
    sys.dont_write_bytecode = True
    import make_presets as presets

    fine = check_sheets(presets, presets.sheets_of(pathlib.Path(root) / "config/drives"))
    fine &= check_rules(presets)
    check = subprocess.run([sys.executable, f"{root}/config/drives/make_presets.py", "--check"], capture_output=True, text=True)
    fine &= expect(check.stderr.strip() or "--check", check.returncode == 0)
    return 0 if fine else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
