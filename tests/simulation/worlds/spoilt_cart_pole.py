# SPDX-License-Identifier: Apache-2.0
"""docs/examples/python-world/cart_pole.py, which after two seconds spoils what its seed says: 2 hangs, 3 dies, 4 sends invalid answers, 5 raises,
6 loses, 7 is done; the others go on. Usage: spoilt_cart_pole.py SOCKET [done: it says when the task is done]"""
import importlib.util
import os
import pathlib
import sys
import time
import types

root = pathlib.Path(__file__).resolve().parents[3]
sys.dont_write_bytecode = True


def load(name, path):
    spec = importlib.util.spec_from_file_location(name, root / path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


# The module alone: the package around it wants libtakt-client, a world does not.
sys.modules["takt"] = types.ModuleType("takt")
sys.modules["takt"].world = world = load("takt.world", "client/python/takt/world.py")
example = load("cart_pole", "docs/examples/python-world/cart_pole.py")


class Spoilt(example.CartPole):
    def reset(self, robot, seed, q):
        self.seed = seed
        return super().reset(robot, seed, q)

    def step(self, drive, seconds):
        state = super().step(drive, seconds)
        if self.time < 2:
            return state
        if self.seed == 2:
            time.sleep(600)
        if self.seed == 3:
            os._exit(7)
        if self.seed == 4:
            return world.State([float("nan"), 0], self.dq)
        if self.seed == 5:
            raise RuntimeError("the renderer lost its screen")
        if self.seed == 6:
            return world.State(self.q, self.dq, outcome=world.FAILED, reason="dropped the cup")
        if self.seed == 7:
            return world.State(self.q, self.dq, outcome=world.SUCCEEDED, reason="poured")
        return state


if __name__ == "__main__":
    world.serve(Spoilt(), sys.argv[1], name="spoilt", error=True, done=sys.argv[2:] == ["done"], sensor=("target", 1))
