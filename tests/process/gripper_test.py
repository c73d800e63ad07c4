#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: an arm with a parallel gripper goes from its model to a gripper that closes on command and holds, with no edit of the robot file but the
`policy` that docs/configuration.md gives. Method: `takt config new` of an MJCF and of a URDF of our own, `takt config check`, then `takt run` of
the MJCF's with a Python policy that opens the gripper and closes it on a cube; where the driven finger is, the plant's truth log says.
Usage: gripper_test.py SOURCE_DIR BUILD_DIR. Exit codes: 0 fine, 1 not.
"""
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

END_S, CLOSE_AT_S = 8, 3
OPEN_M, CUBE_M, OFF_M = 0.04, 0.015, 0.003  # contacts of MuJoCo's give way

ARM = """<mujoco><worldbody>
  <geom name="shelf" type="box" size="0.05 0.05 0.01" pos="0.5 0 0.46"/>
  <body name="cube" pos="0.5 0 0.485"><freejoint/><geom type="box" size="0.015 0.015 0.015" mass="0.05" solref="0.004 1" solimp="0.99 0.999 0.001"/></body>
  <body name="upper" pos="0 0 0.5"><joint name="shoulder" axis="0 0 1" range="-90 90" armature="0.02"/>
    <geom type="capsule" fromto="0 0 0 0.25 0 0" size="0.02" mass="1"/>
    <body name="hand" pos="0.25 0 0"><joint name="wrist" axis="0 0 1" range="-90 90" armature="0.02"/>
      <geom type="capsule" fromto="0 0 0 0.15 0 0" size="0.02" mass="0.5"/>
      <body name="left" pos="0.25 0 0"><joint name="finger" type="slide" axis="0 1 0" range="0 0.04" armature="0.1"/>
        <geom type="box" size="0.02 0.002 0.02" pos="0 0.002 0" mass="0.03"/></body>
      <body name="right" pos="0.25 0 0"><joint name="finger_right" type="slide" axis="0 -1 0" range="0 0.04"/>
        <geom type="box" size="0.02 0.002 0.02" pos="0 -0.002 0" mass="0.03"/></body>
    </body></body></worldbody>
  <equality><joint joint1="finger_right" joint2="finger"/></equality>
  <actuator><motor joint="shoulder" ctrlrange="-20 20"/><motor joint="wrist" ctrlrange="-10 10"/>
    <position joint="finger" kp="200" ctrlrange="0 0.04" forcerange="-25 25"/></actuator>
  <keyframe><key name="home" qpos="0.5 0 0.485 1 0 0 0 0 0 0.03 0.03"/></keyframe>
</mujoco>"""

LINK = """<link name="{}"><inertial><origin xyz="{}"/><mass value="0.2"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
URDF = ("""<robot name="gripper"><link name="base"/>""" + LINK.format("hand", "0.1 0 0") + LINK.format("left", "0 0 0") + LINK.format("right", "0 0 0") + """
  <joint name="wrist" type="revolute"><parent link="base"/><child link="hand"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="2"/></joint>
  <joint name="finger" type="prismatic"><parent link="hand"/><child link="left"/><axis xyz="0 1 0"/><limit lower="0" upper="0.04" effort="25" velocity="0.15"/></joint>
  <joint name="finger_right" type="prismatic"><parent link="hand"/><child link="right"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.04" effort="25" velocity="0.15"/><mimic joint="finger"/></joint></robot>""")

POLICY = """
policy:
  file: grip.py
  period: 20 ms
  step_period: 20 ms
  steps: 10
  observation: [{ term: joint_position }]
"""

GRIP = f"""#!/usr/bin/env python3
import numpy, takt
spec = takt.Policy(observation={{"state": takt.joints("q")}}, action=takt.chunk("q", steps=10, step="20 ms"))
with takt.connect("arm.yaml", spec) as robot:
    began = None
    for obs in robot:
        began = began or (obs.time if obs.mode == "tracking" else None)
        target = numpy.array(robot.home)
        target[robot.joints.index("finger")] = 0 if began and obs.time - began > {CLOSE_AT_S}e9 else {OPEN_M}
        obs.publish(q=numpy.tile(target, (10, 1)))
"""


def wrong(said, why):
    print(said[-4000:], f"WRONG: {why}", sep="\n")
    return 1


def main():
    source, build = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
    with tempfile.TemporaryDirectory(prefix="takt-gripper.") as made:
        folder = pathlib.Path(made)

        def takt(*words, **how):
            return subprocess.run([build / "bin/takt", *map(str, words)], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120, **how)

        for name, model in (("arm", ARM), ("urdf", URDF)):
            (folder / f"{name}.xml").write_text(model)
            new = takt("config", "new", f"{name}.xml", "--simulated", "-o", f"{name}.yaml")
            check = takt("config", "check", f"{name}.yaml")
            if new.returncode or check.returncode or "no FILL_IN" not in new.stdout:
                return wrong(new.stdout + check.stdout, f"{name}: {new.returncode}, {check.returncode}")
            if "finger_right" not in new.stdout or "move freely" in new.stdout:
                return wrong(new.stdout, f"{name}: the other finger follows, and nothing is left loose")
        robot = folder / "arm.yaml"
        # A machine that stalls now and then is none of this test's.
        text = re.sub(r"stop_after: .*", "stop_after: 5 s", re.sub(r"max_age: .*", "max_age: 2 s", robot.read_text())).replace("timeout: 100 ms", "timeout: 400 ms")
        robot.write_text(text + POLICY)
        (folder / "grip.py").write_text(GRIP)
        (folder / "grip.py").chmod(0o755)
        environment = dict(os.environ, PYTHONPATH=str(source / "client/python"), LD_LIBRARY_PATH=str(build / "lib"), PATH="/usr/bin:/bin")
        run = takt("run", "arm.yaml", "--policy-host", folder / "grip.py", "--arm", "--duration", f"{END_S}s", "--to-the-end", "--allow-non-realtime",
                   "--runtime-dir", "sockets", "--run-dir", "run", "--plant=--truth=truth.jsonl", env=environment)
        transitions = [json.loads(line) for line in (folder / "run/transitions.jsonl").read_text().splitlines()] if (folder / "run/transitions.jsonl").exists() else []
        tracking = [each["monotonic_ns"] for each in transitions if each["to"] == "tracking"]
        truth = [json.loads(line) for line in (folder / "truth.jsonl").read_text().splitlines()] if (folder / "truth.jsonl").exists() else []
    if not tracking or not truth:
        return wrong(run.stdout, f"it never tracked: {transitions}")
    closes = tracking[0] + CLOSE_AT_S * 1e9
    before = [each["q"][2] for each in truth if closes - 0.3e9 < each["monotonic_ns"] < closes - 0.1e9]
    held = [each["q"][2] for each in truth if closes + 2e9 < each["monotonic_ns"] < closes + 3e9]
    print(f"open: {before[-1]:.4f} m; closed on the cube: {min(held):.4f} to {max(held):.4f} m")
    if abs(before[-1] - OPEN_M) > OFF_M:
        return wrong(run.stdout, f"the gripper is not open: {before[-1]} m")
    if max(abs(each - CUBE_M) for each in held) > OFF_M:
        return wrong(run.stdout, f"the gripper does not hold the cube: {min(held)} to {max(held)} m")
    return 0


if __name__ == "__main__":
    sys.exit(main())
