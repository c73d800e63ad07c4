# SPDX-License-Identifier: Apache-2.0
"""A world that stands still and films: of every fourth step an image of 4 x 6 x 3 bytes, 7 i + 31 sequence, sensed 2 ms before.
Usage: filming.py SOCKET memory|socket"""
import importlib.util
import pathlib
import sys

import numpy as np

# The module alone: the package around it wants libtakt-client, a world does not.
path = pathlib.Path(__file__).resolve().parents[3] / "client/python/takt/world.py"
spec = importlib.util.spec_from_file_location("world", path)
world = importlib.util.module_from_spec(spec)
sys.modules["world"] = world
sys.dont_write_bytecode = True
spec.loader.exec_module(world)

SHAPE = (4, 6, 3)


class Filming:
    def reset(self, robot, seed, q):
        self.q, self.steps, self.place = q.copy(), 0, robot.images.get("cam0")
        return world.State(self.q, 0.0)

    def step(self, drive, seconds):
        self.steps += 1
        if self.steps % 4:
            return world.State(self.q, 0.0)
        sequence = self.steps // 4
        pixels = ((7 * np.arange(np.prod(SHAPE)) + 31 * sequence) % 256).astype(np.uint8).reshape(SHAPE)
        if sequence % 2:  # in place
            self.place[:] = pixels
            pixels = self.place
        return world.State(self.q, 0.0, images={"cam0": world.Image(pixels, age=0.002)})


if __name__ == "__main__":
    world.serve(Filming(), sys.argv[1], name="filming.py", cameras={"cam0": SHAPE}, shared_memory=sys.argv[2] == "memory")
