# SPDX-License-Identifier: Apache-2.0
"""A policy server as openpi's speaks, by python3-websockets and python3-msgpack, that behaves as a test says."""
import asyncio
import itertools
import threading

import msgpack
import numpy as np
import websockets

STEPS, JOINTS = 4, 3
measured = itertools.count(1)


def array(values, dtype="<f4", shape=None):
    values = np.asarray(values, np.float32)
    return {b"__ndarray__": True, b"data": values.tobytes(), b"dtype": dtype, b"shape": shape or values.shape}


def timing():
    """Another one for every answer, as what is measured is."""
    return {"infer_ms": 1e-6 * next(measured)}


def answer(number, width=JOINTS, steps=STEPS + 2, **more):
    return msgpack.packb({"actions": array(np.full((steps, width), number)), **{"server_timing": timing(), **more}})


async def well(peer, asked, _):
    await peer.send(answer(asked["n"]))


class OpenPiServer:
    """Accepts one connection after the other, on a thread; `behaves(peer, question, count)` is awaited for each question. `tls`: its ssl.SSLContext."""

    def __init__(self, behaves=well, metadata=b"\x81\xa5reset\xc0", port=0, tls=None):
        self.behaves, self.metadata, self.port, self.tls = behaves, metadata, port, tls
        self.questions, self.connections = 0, 0
        self.peers = set()
        self.loop, ready = asyncio.new_event_loop(), threading.Event()
        self.thread = threading.Thread(target=self._run, args=(ready,))
        self.thread.start()
        ready.wait()
        self.url = f"{'wss' if tls else 'ws'}://127.0.0.1:{self.port}"

    def _run(self, ready):
        self.over = asyncio.Event()
        self.loop.run_until_complete(self._serve(ready))

    async def _serve(self, ready):
        async with websockets.serve(self._converse, "127.0.0.1", self.port, ssl=self.tls, compression=None, max_size=None,
                                    close_timeout=0.1) as server:
            self.port = server.sockets[0].getsockname()[1]
            ready.set()
            await self.over.wait()

    async def _converse(self, peer, _path=None):
        self.connections += 1
        self.peers.add(peer)
        self.headers = peer.request.headers if hasattr(peer, "request") else peer.request_headers  # from websockets 13 on, before
        try:
            if self.metadata is not None:
                await peer.send(self.metadata)
            async for message in peer:
                self.questions += 1
                await self.behaves(peer, msgpack.unpackb(message, strict_map_key=False), self.questions)
        except websockets.ConnectionClosed:
            pass
        finally:
            self.peers.discard(peer)

    def hang_up(self):
        """Ends the connections that there are."""
        self.loop.call_soon_threadsafe(lambda: [peer.transport.abort() for peer in self.peers])

    def leave(self):
        """Begins to close; close() ends it."""
        self.loop.call_soon_threadsafe(self.over.set)

    def close(self):
        """A second time does nothing."""
        if self.loop.is_closed():
            return
        self.leave()
        self.thread.join()
        self.loop.close()
