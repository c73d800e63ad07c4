#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A camera that is none: a bright spot that wanders through a dark image. With OpenCV: `_, image[:] = capture.read()`, of a frame of this shape."""
import math
import time

import takt

with takt.Sensor("cam0", "robot.yaml", shape=(48, 64, 1), dtype="uint8") as camera:
    while True:
        shutter = time.monotonic_ns()
        image = camera.values                          # shared memory: fill it in place
        image[:] = 16
        column = int(32 + 20 * math.sin(shutter * 1e-9))
        image[20:28, column - 4:column + 4] = 240
        camera.publish(stamp=shutter)
        time.sleep(1 / 30)
