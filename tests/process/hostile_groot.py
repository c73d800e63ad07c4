# SPDX-License-Identifier: Apache-2.0
"""GR00T's server, well and in many bad ways."""
import io

import msgpack
import numpy as np
from groot_server import GrootServer, npy
from hostile import CUT, DRIBBLE, Behaviour, Hostile, will_stall
from served_robot import actions


class HostileGroot(Hostile):
    def __init__(self):
        self.replies = []
        super().__init__(GrootServer(self.behave))

    def behave(self, question, _count):
        asked = dict(question["data"]["observation"])
        asked["home"] = np.load(io.BytesIO(asked["home"]["as_npy"]))
        way = self.way(HostileGroot.well)
        reply = way(self, asked)
        if way is not HostileGroot.well:
            self.acts["all"] += 1
        return reply

    def reply(self, values):
        return msgpack.packb([{"action.arm": npy(values[None])}, {}])

    def well(self, asked):
        self.answered.add(asked["n"])
        self.replies.append(self.reply(actions(asked)))
        return self.replies[-1]

    def silent(self, asked):
        return None

    def stalls(self, asked):
        self.stall_once()
        return self.well(asked)

    def error(self, asked):
        return msgpack.packb({"error": "no such modality"})

    def narrow(self, asked):
        return self.reply(actions(asked)[:, :-1])

    def not_finite(self, asked):
        values = actions(asked)
        values[3, 2] = np.nan
        return self.reply(values)

    def too_large(self, asked):
        return bytes(17 << 20)

    def the_last_one_again(self, asked):
        self.server.socket.send_multipart([*self.server.envelopes[-2], self.replies[-1]])
        return self.well(asked)


BEHAVIOURS = {
    "takes questions and never answers": Behaviour(HostileGroot.silent),
    "stalls for 5 s": Behaviour(HostileGroot.stalls, will_stall),
    "is cut off": CUT,
    "sends one byte a second": DRIBBLE,
    "says an error": Behaviour(HostileGroot.error),
    "answers of another width": Behaviour(HostileGroot.narrow),
    "answers NaN": Behaviour(HostileGroot.not_finite),
    "sends 17 MiB": Behaviour(HostileGroot.too_large),
    "answers again after the next question": Behaviour(HostileGroot.the_last_one_again, stops=False),
}
SERVER = HostileGroot
