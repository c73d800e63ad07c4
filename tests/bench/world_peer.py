# SPDX-License-Identifier: Apache-2.0
"""The Python side of `./dev bench world`: a world whose work is nothing. Usage: world_peer.py SOCKET memory|socket"""
import sys

import numpy as np
from takt import world


class Nothing:
    def reset(self, robot, seed, q):
        self.state = world.State(q.copy(), np.zeros_like(q))
        return self.state

    def step(self, drive, seconds):
        return self.state


world.serve(Nothing(), sys.argv[1], shared_memory=sys.argv[2] == "memory")
