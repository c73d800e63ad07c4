# SPDX-License-Identifier: Apache-2.0
"""The Python side of `./dev bench python`: a policy whose inference is nothing, so that all that is left is what Takt costs."""
import sys

import numpy as np
import takt

spec = takt.Policy(observation={"state": takt.joints("q", "dq"), "target": takt.stream("target", 3)},
                   action=takt.chunk("q", steps=16, step="10 ms"))
with takt.connect(sys.argv[1], spec, runtime_dir=sys.argv[2]) as robot:
    actions = np.tile(robot.home, (robot.steps, 1))
    for obs in robot:
        with obs.infer():
            pass
        obs.publish(q=actions)
