# SPDX-License-Identifier: Apache-2.0
"""openpi's server, well and in many bad ways."""
import asyncio
import contextlib

import msgpack
import numpy as np
import websockets
from hostile import CUT, DRIBBLE, Behaviour, Hostile, will_stall
from openpi_server import OpenPiServer, array, timing
from served_robot import actions

SPEAKS, ECHOES = msgpack.packb({"reset": None}), msgpack.packb({"echo": "question"})
LATER_THAN_THE_DEADLINE_S = 0.3
GIGABYTE = 1 << 30


class HostileOpenPi(Hostile):
    def __init__(self):
        self.sent = []
        super().__init__(OpenPiServer(self.behave, SPEAKS))

    async def behave(self, peer, asked, _count):
        asked["home"] = np.frombuffer(asked["home"][b"data"], np.float32)
        way = self.way(HostileOpenPi.well)
        await way(self, peer, asked)
        if way is not HostileOpenPi.well:
            self.acts[peer] += 1

    def reply(self, asked, values=None, **more):
        echo = {key: asked[key] for key in ("question",) if key in asked}
        return msgpack.packb({"actions": array(actions(asked) if values is None else values), "server_timing": timing(), **echo, **more})

    async def well(self, peer, asked, **more):
        self.answered.add(asked["n"])
        self.sent.append(self.reply(asked, **more))
        await peer.send(self.sent[-1])

    async def silent(self, peer, asked):
        pass

    async def late(self, peer, asked):
        await asyncio.sleep(LATER_THAN_THE_DEADLINE_S)
        await peer.send(self.reply(asked))

    async def stalls(self, peer, asked):
        self.stall_once()
        await self.well(peer, asked)

    async def error_in_words(self, peer, asked):
        await peer.send("Traceback (most recent call last):\n  File x\nKeyError: 'prompt'\n")
        await peer.close(1011, "Internal server error")

    async def closes(self, peer, asked):
        await peer.close(1011, "out of memory")

    async def narrow(self, peer, asked):
        await peer.send(self.reply(asked, actions(asked)[:, :-1]))

    async def not_finite(self, peer, asked):
        values = actions(asked)
        values[3, 2] = np.nan
        await peer.send(self.reply(asked, values))

    async def gigabyte(self, peer, asked):
        async def pieces():
            for _ in range(GIGABYTE >> 20):
                yield bytes(1 << 20)
        with contextlib.suppress(websockets.exceptions.InvalidState):  # it is no longer listened to
            await peer.send(pieces())

    async def claims_a_gigabyte(self, peer, asked):
        await peer.send(msgpack.packb({"actions": array(actions(asked), shape=[GIGABYTE // 4, 1]), "server_timing": timing()}))

    async def old_chunks(self, peer, asked):
        await peer.send(self.sent[-5])

    async def mixed_up(self, peer, asked):
        """As a server that lost count: by one question, each with a time of its own. Its echo tells."""
        await peer.send(self.reply({**asked, "n": asked["n"] - 1, "question": asked["question"] - 1}))

    async def twice(self, peer, asked):
        await self.well(peer, asked)
        await peer.send(self.sent[-1])

    async def the_last_one_again(self, peer, asked):
        await peer.send(self.sent[-1])
        await self.well(peer, asked)

    async def clock_jumps(self, peer, asked):
        times = (-1e18, 1e18, float("nan"))[asked["n"] % 3]
        await self.well(peer, asked, policy_timing={"infer_ms": times}, server_timing={"infer_ms": times, "prev_total_ms": times})

    def greet(self, metadata):
        """From now on, and those who are connected come anew."""
        self.server.metadata = metadata
        self.server.hang_up()


def greets(metadata):
    return lambda server: server.greet(metadata)


BEHAVIOURS = {
    "takes questions and never answers": Behaviour(HostileOpenPi.silent),
    "accepts connections and never speaks": Behaviour(begins=greets(None), ends=greets(SPEAKS)),
    "answers after the deadline": Behaviour(HostileOpenPi.late),
    "stalls for 5 s": Behaviour(HostileOpenPi.stalls, will_stall),
    "is cut off": CUT,
    "sends one byte a second": DRIBBLE,
    "says an error": Behaviour(HostileOpenPi.error_in_words),
    "closes with 1011": Behaviour(HostileOpenPi.closes),
    "answers of another width": Behaviour(HostileOpenPi.narrow),
    "answers NaN": Behaviour(HostileOpenPi.not_finite),
    "sends 1 GB": Behaviour(HostileOpenPi.gigabyte),
    "claims 1 GB": Behaviour(HostileOpenPi.claims_a_gigabyte),
    "sends old chunks": Behaviour(HostileOpenPi.old_chunks),
    "mixes questions up, with an echo": Behaviour(HostileOpenPi.mixed_up, before=greets(ECHOES), ends=greets(SPEAKS)),
    "answers twice": Behaviour(HostileOpenPi.twice, stops=False),
    "answers again after the next question": Behaviour(HostileOpenPi.the_last_one_again, stops=False),
    "has a clock that jumps": Behaviour(HostileOpenPi.clock_jumps, stops=False),
}
SERVER = HostileOpenPi
