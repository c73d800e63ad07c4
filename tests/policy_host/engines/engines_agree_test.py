#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the built-in engine, ONNX Runtime, TorchScript and a policy in Python say the same of the same observations, to 1e-5, hidden state
and a reset included; what TorchScript cannot tell is refused. Method: PyTorch makes networks and writes each as ONNX and as TorchScript;
`takt-engine-answers` runs 20 observations through each engine by a robot file that differs in `policy.engine` alone; PyTorch itself is the
judge. A policy by the package `takt` drives the demo arm, writes down what it was shown and said, and the engines are shown the same.
Usage: engines_agree_test.py SOURCE_DIR BUILD_DIR
"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest
import warnings

try:
    import numpy as np
    import torch
    from torch import nn
except ImportError as missing:
    print(f"NOT TESTED: {missing} (./dev test installs it)")
    sys.exit(77)

SOURCE, BUILD = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
sys.path[:0] = [str(SOURCE / "tests/process"), str(SOURCE / "tests/bench")]
from inference_networks import Layer  # noqa: E402
from patient import patient  # noqa: E402

OBSERVATION, ACTIONS, OBSERVATIONS, RESET = 24, 96, 20, 12  # of the demo arm
JOINTS, IMAGE = 6, (1, 1, 48, 64)
SHAPES = ", shapes: [{ tensor: obs, shape: [1, 6] }, { tensor: image, shape: [1, 1, 48, 64] }]"
TOLERANCE = 1e-5
STATE = ", shapes: [{ tensor: h_in, shape: [1, 1, 32] }, { tensor: c_in, shape: [1, 1, 32] }"
RUNTIME = next(iter(sorted((SOURCE / "tests/node/node_modules/onnxruntime-node/bin").glob("*/linux/x64/libonnxruntime.so.1"))), None)
TORCHSCRIPT = next(iter(BUILD.glob("lib*/**/takt-engine-torchscript.so")), None)


class Perceptron(nn.Module):
    def __init__(self):
        super().__init__()
        self.layers = nn.Sequential(nn.Linear(OBSERVATION, 128), nn.ELU(), nn.Linear(128, 64), nn.ELU(), nn.Linear(64, ACTIONS))

    def forward(self, obs):
        return self.layers(obs)


class Recurrent(nn.Module):
    """State as arguments and results."""

    def __init__(self):
        super().__init__()
        self.memory, self.head = nn.LSTM(OBSERVATION, 32), nn.Linear(32, ACTIONS)

    def forward(self, obs, h_in, c_in):
        y, (h_out, c_out) = self.memory(obs.unsqueeze(0), (h_in, c_in))
        return self.head(y.squeeze(0)), h_out, c_out


class Remembering(nn.Module):
    """The same network; state inside, as rsl_rl's TorchScript exporter keeps it."""

    def __init__(self, recurrent):
        super().__init__()
        self.memory, self.head = recurrent.memory, recurrent.head
        self.register_buffer("h", torch.zeros(1, 1, 32))
        self.register_buffer("c", torch.zeros(1, 1, 32))

    def forward(self, obs):
        y, (h, c) = self.memory(obs.unsqueeze(0), (self.h, self.c))
        self.h[:] = h
        self.c[:] = c
        return self.head(y.squeeze(0))

    @torch.jit.export
    def reset(self):
        self.h[:] = 0.0
        self.c[:] = 0.0


class Counting(nn.Module):
    """Remembers, and cannot be made to forget."""

    def __init__(self):
        super().__init__()
        self.register_buffer("calls", torch.zeros(1))

    def forward(self, obs):
        self.calls += 1.0
        return obs.repeat(1, 4) + self.calls


class Pretending(Counting):
    """Has a method for it, which does nothing."""

    @torch.jit.export
    def reset(self):
        pass


class Chunk(nn.Module):
    """A transformer over the 16 steps of the chunk."""

    def __init__(self, d=32):
        super().__init__()
        self.d = d
        self.into, self.layer, self.head = nn.Linear(OBSERVATION, 16 * d), Layer(d, 4, 2 * d), nn.Linear(d, 6)

    def forward(self, obs):
        x = self.into(obs).view(1, 16, self.d)
        return self.head(self.layer(x, x)).view(1, 96)


class Looking(nn.Module):
    """Joints, and an image of 48 x 64."""

    def __init__(self):
        super().__init__()
        self.see = nn.Sequential(nn.Conv2d(1, 4, 5, stride=4), nn.ELU(), nn.Conv2d(4, 4, 3, stride=2, padding=1), nn.ELU(), nn.Flatten())
        self.head = nn.Sequential(nn.Linear(JOINTS + 4 * 6 * 8, 64), nn.ELU(), nn.Linear(64, ACTIONS))

    def forward(self, obs, image):
        return self.head(torch.cat([obs, self.see(image)], 1))


def looks(text):
    """The demo arm with a camera, whose policy is shown its joints and its newest image."""
    lines = [line for line in text.splitlines() if "term: joint_velocity" not in line and "term: last_action" not in line]
    text = "\n".join(lines).replace("  input: obs", '  input: "obs,image"')
    text = text.replace("{ term: sensor, sensor: target, scale: 1, history: 2 }", "{ term: sensor, sensor: cam0 }")
    return text.replace("\nsensors:\n", "\nsensors:\n  - { name: cam0, image: { height: 48, width: 64, channels: 1 }, timeout: 500 ms }\n") + "\n"


class Engines(unittest.TestCase):
    def setUp(self):
        warnings.simplefilter("ignore")  # the exporter's
        torch.manual_seed(7)
        self.robots = 0
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="takt-engines."))
        self.addCleanup(shutil.rmtree, self.folder)
        self.observations = np.random.default_rng(3).uniform(-1, 1, (OBSERVATIONS, OBSERVATION)).astype(np.float32)

    def write(self, name, module, state=()):
        module.eval()
        zeros = tuple(torch.zeros(1, 1, 32) for _ in state)
        torch.onnx.export(module, (torch.zeros(1, OBSERVATION), *zeros), self.folder / f"{name}.onnx", input_names=["obs", *state],
                          output_names=["actions", *(s.replace("_in", "_out") for s in state)], opset_version=14)
        self.script(name, module)

    def script(self, name, module):
        torch.jit.script(module.eval()).save(self.folder / f"{name}.pt")

    def robot(self, file, engine, extra="", change=lambda text: text):
        text = (SOURCE / "config/arm6.yaml").read_text()
        self.assertIn("  file: arm6_reach.onnx", text)
        text = change(text).replace("  file: arm6_reach.onnx", f"  file: {file}\n  engine: {{ name: {engine}{extra} }}")
        self.robots += 1
        path = self.folder / f"robot{self.robots}.yaml"
        path.write_text(text)
        return path

    def answers(self, robot, observations=None, resets=(RESET,)):
        (self.observations if observations is None else observations).astype(np.float32).tofile(self.folder / "in")
        done = subprocess.run([BUILD / "bin/takt-engine-answers", robot, self.folder / "in", ",".join(map(str, resets)), self.folder / "out"],
                              capture_output=True, text=True, timeout=120, check=False)
        self.engine = done.stdout.strip()
        if done.returncode != 0:
            return done.stderr
        return np.fromfile(self.folder / "out", np.float32).reshape(-1, ACTIONS)

    def engines(self, name, shapes="", change=lambda text: text):
        yield "built-in", self.robot(f"{name}.onnx", "builtin", change=change)
        if RUNTIME:
            yield "ONNX Runtime", self.robot(f"{name}.onnx", "onnxruntime", f", library: {RUNTIME}", change)
        if TORCHSCRIPT:
            yield "TorchScript", self.robot(f"{name}.pt", "torchscript", shapes, change)

    def agree(self, answers, expected, who):
        self.assertNotIsInstance(answers, str, f"{who}: {answers}")
        apart = np.max(np.abs(answers - expected) / np.maximum(1, np.abs(expected)))
        self.assertLessEqual(apart, TOLERANCE, who)
        self.assertGreater(np.ptp(expected[:, 0]), 1e-3)  # it says something

    def test_networks_without_memory(self):
        for name, module in (("perceptron", Perceptron()), ("chunk", Chunk())):
            self.write(name, module)
            with torch.no_grad():
                expected = np.concatenate([module(torch.from_numpy(row[None])).numpy() for row in self.observations])
            for who, robot in self.engines(name):
                self.agree(self.answers(robot), expected, f"{who}, {name}")

    def test_state_goes_round_and_is_forgotten(self):
        module = Recurrent()
        self.write("recurrent", module, ("h_in", "c_in"))
        self.script("remembering", Remembering(module))
        expected, zero = [], torch.zeros(1, 1, 32)
        with torch.no_grad():
            for i, row in enumerate(self.observations):
                if i in (0, RESET):
                    h = c = zero
                y, h, c = module(torch.from_numpy(row[None]), h, c)
                expected.append(y.numpy()[0])
        expected = np.array(expected)
        for who, robot in self.engines("recurrent", STATE + "]"):
            self.agree(self.answers(robot), expected, f"{who}, recurrent")
        if TORCHSCRIPT:
            self.agree(self.answers(self.robot("remembering.pt", "auto")), expected, "TorchScript, state inside")

    def test_what_torchscript_cannot_tell_is_refused(self):
        if not TORCHSCRIPT:
            self.skipTest("NOT TESTED: built without libtorch-dev")
        module = Recurrent()
        self.script("recurrent", module)
        self.script("counting", Counting())
        self.script("pretending", Pretending())

        class Words(nn.Module):
            def forward(self, obs, task: str):
                return obs

        self.script("words", Words())
        for robot, said in (
                (self.robot("recurrent.pt", "torchscript"), "recurrent.pt: the file does not say what shape forward's argument h_in has"),
                (self.robot("recurrent.pt", "torchscript", STATE + ", { tensor: x, shape: [1] }]"), "forward has no argument x"),
                (self.robot("recurrent.pt", "torchscript", STATE.replace("32", "31") + "]"), "recurrent.pt: "),
                (self.robot("words.pt", "torchscript"), "forward's argument task is a str"),
                (self.robot("counting.pt", "torchscript"), "answers the same input differently the second time, and has no method reset() or reset_memory()"),
                (self.robot("pretending.pt", "torchscript"), "that makes it forget; export it with one")):
            refused = self.answers(robot)
            self.assertIsInstance(refused, str)
            self.assertEqual(refused.count("\n"), 1, refused)
            self.assertIn(said, refused)

    def test_torchscript_says_whose_linear_algebra_it_has_and_holds_it_to_its_threads(self):
        if not TORCHSCRIPT:
            self.skipTest("NOT TESTED: built without libtorch-dev")
        self.script("perceptron", Perceptron())
        self.answers(self.robot("perceptron.pt", "torchscript"))
        self.assertRegex(self.engine, r"^TorchScript, libtorch \S+, (OpenBLAS \S+|reference BLAS \(slow: install libopenblas0-pthread\)|BLAS of \S+), cpu, 1 thread")
        self.assertRegex(self.engine, r"\nthreads: 1$", "a pool of some library's")

    def test_what_is_quicker_elsewhere_is_handed_over_or_refused(self):
        self.write("small", Chunk())
        self.write("large", Chunk(256))
        self.answers(self.robot("small.onnx", "auto"))
        self.assertRegex(self.engine, "^built-in engine\n")
        refused = self.answers(self.robot("large.onnx", "auto", ", library: /nowhere/libonnxruntime.so"))
        self.assertRegex(refused, r"large.onnx: 8.\d million multiply-adds in products of matrices, which ONNX Runtime does quicker; "
                                  r"/nowhere/libonnxruntime.so: cannot be loaded: .*; or run it slower, by policy.engine: { name: builtin }\n$")
        if RUNTIME:
            self.answers(self.robot("large.onnx", "auto", f", library: {RUNTIME}"))
            self.assertRegex(self.engine, "^ONNX Runtime ")

    def test_an_image_is_an_input_of_its_own(self):
        module = Looking()
        self.write_looking(module)
        images = np.random.default_rng(5).integers(0, 256, (OBSERVATIONS, *IMAGE)).astype(np.float32) / 255
        observations = np.concatenate([self.observations[:, :JOINTS], images.reshape(OBSERVATIONS, -1)], axis=1)
        with torch.no_grad():
            expected = np.concatenate([module(torch.from_numpy(row[None, :JOINTS]), torch.from_numpy(row[JOINTS:].reshape(IMAGE))).numpy()
                                       for row in observations])
        for who, robot in self.engines("looking", SHAPES, looks):
            self.agree(self.answers(robot, observations), expected, f"{who}, looking")
        turned = self.robot("looking.onnx", "builtin", change=lambda text: looks(text).replace("height: 48, width: 64", "height: 64, width: 48"))
        self.assertIn("looking.onnx: input image is 1 x 48 x 64, the images of sensor cam0 become 1 x 64 x 48: correct", self.answers(turned, observations))

    def write_looking(self, module):
        torch.onnx.export(module.eval(), (torch.zeros(1, JOINTS), torch.zeros(IMAGE)), self.folder / "looking.onnx", input_names=["obs", "image"],
                          output_names=["actions"], opset_version=14)
        self.script("looking", module)

    def test_a_policy_in_python_says_the_same(self):
        self.write("perceptron", Perceptron())
        shown, said = self.drive("perceptron", OBSERVATION, """observation={"state": takt.joints("q", "dq"), "target": takt.stream("target", 3)}""", f"""
        x = np.zeros((1, {OBSERVATION}), np.float32)
        x[0, :15] = np.concatenate([np.ravel(obs.state), np.ravel(obs.target)])
        given = [torch.from_numpy(x)]""")
        for who, robot in self.engines("perceptron"):
            apart = np.max(np.abs(self.answers(robot, shown, (5,)) - said))
            self.assertLessEqual(apart, TOLERANCE, who)

    def test_a_policy_in_python_sees_the_same(self):
        self.write_looking(Looking())
        camera = subprocess.Popen([SOURCE / "docs/examples/python-sensor/camera.py"], cwd=self.folder, env=self.environment(),
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(lambda: (camera.kill(), camera.wait()))
        shown, said = self.drive("looking", JOINTS + IMAGE[2] * IMAGE[3], """observation={"state": takt.joints("q"), "top": takt.image("cam0", shape=(48, 64, 1))}""", """
        x = np.concatenate([np.ravel(obs.state - robot.home), np.ravel(obs.top) / np.float32(255)], dtype=np.float32)[None]
        given = [torch.from_numpy(x[:, :6]), torch.from_numpy(x[:, 6:].reshape(1, 1, 48, 64))]""", looks)
        self.assertGreater(np.ptp(np.argmax(shown[:, JOINTS:].reshape(-1, 48, 64).sum(axis=1), axis=1)), 1, "the spot wandered")
        for who, robot in self.engines("looking", SHAPES, looks):
            apart = np.max(np.abs(self.answers(robot, shown, (5,)) - said))
            self.assertLessEqual(apart, TOLERANCE, who)

    def test_a_trained_network_that_looks_is_the_same_in_python(self):
        sys.path[:0] = [str(SOURCE / "docs/examples/python-sensor"), str(BUILD / "python/staged")]
        from look_network import Network
        trained = SOURCE / "docs/examples/python-sensor/look.onnx"
        images = np.random.default_rng(6).integers(0, 60, (OBSERVATIONS, *IMAGE[2:]))
        for i, image in enumerate(images):  # a spot that wanders
            image[20:28, 2 * i:2 * i + 8] = 240
        images = images.astype(np.float32) / 255
        observations = np.concatenate([self.observations[:, :JOINTS], images.reshape(OBSERVATIONS, -1)], axis=1)
        network = Network(trained)
        expected = np.array([network(row[:JOINTS], image) for row, image in zip(observations, images)])
        shutil.copy(trained, self.folder)
        for who, robot in self.engines("look", SHAPES, looks):
            if who != "TorchScript":
                self.agree(self.answers(robot, observations), expected, f"{who}, trained")

    def environment(self):
        return {**os.environ, "XDG_RUNTIME_DIR": str(self.folder), "PYTHONPATH": str(BUILD / "python/staged"),
                "PATH": f"{BUILD}/bin:/usr/bin:/bin"}

    def drive(self, network, width, observation, given, change=lambda text: text):
        """Drives the demo arm by the network, as TorchScript in a policy in Python: what it was shown, and what it said."""
        text = change(patient((SOURCE / "config/arm6.yaml").read_text())).replace("file: arm6_reach.onnx", "file: policy.py")
        (self.folder / "robot.yaml").write_text(text)
        (self.folder / "policy.py").write_text(f"""#!/usr/bin/python3
import numpy as np, takt, torch
torch.set_num_threads(1)
net = torch.jit.load("{self.folder}/{network}.pt")
spec = takt.Policy({observation}, action=takt.chunk("q", steps=16, step="10 ms"))
shown, said = open("{self.folder}/shown", "ab"), open("{self.folder}/said", "ab")
with takt.connect("robot.yaml", spec) as robot:
    for obs in robot:{given}
        with torch.no_grad(), obs.infer():
            y = net(*given).numpy()
        obs.publish(q=robot.home + 0.1 * np.tanh(y.reshape(16, 6)))
        for file, values in ((shown, x), (said, y)):
            file.write(values.tobytes())
            file.flush()
""")
        (self.folder / "policy.py").chmod(0o755)
        done = subprocess.run(["takt", "run", "robot.yaml", "--policy-host", "./policy.py", "--policy-may", "write=.", "--arm", "--duration", "3s", "--allow-non-realtime",
                               "--run-dir", "run"], cwd=self.folder, env=self.environment(), capture_output=True, text=True, timeout=120, check=False)
        self.assertTrue((self.folder / "said").exists(), done.stdout + done.stderr)
        said = np.fromfile(self.folder / "said", np.float32).reshape(-1, ACTIONS)
        values = np.fromfile(self.folder / "shown", np.float32)
        shown = values[:values.size // width * width].reshape(-1, width)[:len(said)]
        self.assertGreater(len(said), 10, done.stdout + done.stderr)
        return shown, said


if __name__ == "__main__":
    missing = [name for name, there in (("ONNX Runtime (tests/node)", RUNTIME), ("TorchScript (libtorch-dev)", TORCHSCRIPT)) if not there]
    for name in missing:
        print(f"NOT TESTED: {name} is not there")
    if missing and "TAKT_REQUIRE_NODE" in os.environ:
        sys.exit(1)
    unittest.main(argv=sys.argv[:1], verbosity=2)
