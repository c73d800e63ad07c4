#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: a PyTorch policy is a policy: what it has learned is its identity, its tensors are observations and answers, and what the robot got is what the network
says of what it was shown. Method: `takt run` with real processes and a small network of PyTorch's (Debian's python3-torch); the recorded run is read, and the
network asked again. Usage: torch_policy_test.py SOURCE_DIR BUILD_DIR. Exit code 77: PyTorch, pandas or zstandard is missing.
"""
import hashlib
import sys
import unittest

import numpy as np

from python_rig import PythonRig

try:
    import pandas  # noqa: F401
    import torch
    import zstandard  # noqa: F401
except ImportError as error:
    print(f"SKIPPED: {error}: NO POLICY OF PYTORCH RAN")
    sys.exit(77)
import takt  # noqa: E402

NETWORK = """
import torch
torch.set_num_threads(1)

class Net(torch.nn.Module):
    def __init__(self):
        super().__init__()
        self.body = torch.nn.Sequential(torch.nn.Linear(15, 32), torch.nn.Tanh(), torch.nn.Linear(32, 16 * 6))

    def forward(self, state, target, home):
        return home + 0.05 * torch.tanh(self.body(torch.cat((state.flatten(), target)))).view(16, 6)
"""
POLICY = NETWORK + """
import warnings
import takt
warnings.simplefilter("error")

spec = takt.Policy(observation={"state": takt.joints("q", "dq"), "target": takt.stream("target", 3)}, action=takt.chunk("q", steps=16, step="10 ms"))
net = Net()
with takt.connect("robot.yaml", spec) as robot, torch.inference_mode():
    net.load_state_dict(torch.load(robot.policy_file))
    home = torch.tensor(robot.home)
    for obs in robot:
        with obs.infer():
            actions = net(torch.tensor(obs.state), torch.tensor(obs.target), home)
        obs.publish(q=actions)
"""


class TorchPolicy(PythonRig):
    def test_the_robot_gets_what_the_network_says(self):
        names = {}
        exec(NETWORK, names)
        torch.manual_seed(1)
        net = names["Net"]()
        torch.save(net.state_dict(), self.folder / "net.pt")
        self.replace(("file: policy.py", "file: net.pt"))
        self.policy(POLICY)
        done, log = self.run_robot("4s")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr + log)
        self.assertNotIn("Warning", log)
        self.assertIn("tracking", done.stdout)
        run = takt.open(self.folder / "run")
        self.assertEqual(run.manifest["policy"]["sha256"], hashlib.sha256((self.folder / "net.pt").read_bytes()).hexdigest())
        commands = run.commands.drop_duplicates("sequence").set_index("sequence")
        home = torch.tensor([0, 0.6, -1.2, 0, 0.6, 0])
        compared = 0
        for _, shown in run.policy_inputs.iterrows():
            if shown["sequence"] not in commands.index:
                continue
            with torch.inference_mode():
                said = net(torch.tensor(np.stack([shown["q"], shown["dq"]])), torch.tensor(shown["sample_values"][0]), home)
            np.testing.assert_allclose(commands.loc[shown["sequence"], "q"], said, atol=1e-5)
            compared += 1
        self.assertGreater(compared, 50)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=2)
