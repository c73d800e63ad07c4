#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the IMU of MuJoCo's physics reaches the executive: with it the robot arms and tracks, every tick's sample is usable and says
which way is up; without one the robot does not arm, and says why; one that a scenario cuts stops it, and a scenario that strikes a sensor
which the simulation does not play is refused. Method: the demo arm as MJCF, its base body with a site, in real processes by `takt run`:
with the IMU's site in the robot file, without, and with each scenario. Usage: imu_in_a_run_test.py SOURCE_DIR BIN_DIR
"""
import pathlib
import re
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "process"))
from patient import patient  # noqa: E402

LINK = re.compile(r"- \{ joint: (\w+), .*?xyz: \[(.*?)\].*?axis: \[(.*?)\], mass: ([\d.]+) kg, com: \[(.*?)\], +inertia: \[(.*?)\]")
ROTOR = 0.02  # kg m2; what the robot file's `inertia` says of its joints is near it


def numbers(text):
    return " ".join(word.split()[0] for word in text.split(","))


def mjcf_of(robot):
    bodies = [f'<body pos="{numbers(xyz)}"><inertial pos="{numbers(com)}" mass="{mass}" diaginertia="{numbers(inertia)}"/>'
              f'<joint name="{name}" axis="{numbers(axis)}" armature="{ROTOR}"/>'
              for name, xyz, axis, mass, com, inertia in LINK.findall(robot)]
    assert len(bodies) == 6, bodies
    # An attribute that MuJoCo 2.2.2 does not know: the plant corrects it, and says so.
    bodies[0] = bodies[0].replace("armature=", 'actuatorfrcrange="-50 50" armature=')
    return ('<mujoco><compiler angle="radian"/><option timestep="0.001"/><worldbody><site name="imu"/>'
            + "".join(bodies) + "</body>" * 6 + "</worldbody></mujoco>")


def robot_with(source, imu_site):
    text = patient((source / "config/arm6.yaml").read_text())
    text = text.replace("file: arm6_reach.onnx", f"file: {source}/config/arm6_reach.onnx")
    text = text.replace("sensors:\n", "imu: { sensor: base_imu, tilt: 1 rad }\n\nsensors:\n  - { name: base_imu, values: 10, timeout: 500 ms }\n", 1)
    site = "{ model: arm.xml, imu: { site: imu } }" if imu_site else "{ model: arm.xml }"
    return text.replace("simulation:\n", f"simulation:\n  mujoco: {site}\n", 1)


def run(source, programs, folder, name, imu_site, scenario=None):
    robot = folder / f"{name}.yaml"
    robot.write_text(robot_with(source, imu_site))
    extra = []
    if scenario:
        (folder / f"{name}.scenario.yaml").write_text(f"schema: takt.scenario/1\nevents:\n  - {scenario}\n")
        extra = [f"--plant=--scenario={folder}/{name}.scenario.yaml"]
    done = subprocess.run([programs / "takt", "run", robot, "--arm", "--duration", "4s", "--allow-non-realtime", "--runtime-dir", folder / f"{name}.sockets",
                           "--run-dir", folder / name, *extra], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
    return done.stdout


def main():
    source, programs = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    with tempfile.TemporaryDirectory() as where:
        folder = pathlib.Path(where)
        (folder / "arm.xml").write_text(mjcf_of((source / "config/arm6.yaml").read_text()))
        said = run(source, programs, folder, "seen", True)
        assert re.search(r"s  tracking +age", said), said
        log = (folder / "seen/logs/takt-plant.log").read_text()
        assert "model: actuatorfrcrange of joint left out" in log, log
        replay = subprocess.run([programs / "takt", "replay", folder / "seen"], capture_output=True, text=True, timeout=60)
        assert replay.returncode in (0, 2), replay.stdout + replay.stderr
        said = run(source, programs, folder, "blind", False)
        assert "tracking  " not in said and "no usable sample of the base's IMU" in said, said
        said = run(source, programs, folder, "cut", True, "{ after: enabled, at: 1 s, sensor: base_imu, drop: 1 }")
        assert re.search(r"stop at tick \d+: (imu_lost|command_lost)", said), said  # as old as its newest sample is every command
        said = run(source, programs, folder, "nobodys", False, "{ at: 1 s, sensor: base_imu, drop: 1 }")
        assert "drop of 100 % of sensor base_imu, which this simulation does not play" in said, said
    return 0


if __name__ == "__main__":
    sys.exit(main())
