# SPDX-License-Identifier: Apache-2.0
"""A policy server as GR00T's speaks, by python3-zmq and python3-msgpack, that behaves as a test says."""
import io
import threading

import msgpack
import numpy as np
import zmq


def npy(values, **how):
    file = io.BytesIO()
    np.save(file, values, **how)
    return {"__ndarray_class__": True, "as_npy": file.getvalue()}


class GrootServer:
    """`behaves(question, count)` gives the reply's bytes, or None: none at all. `afterwards(envelope)`: once it is sent. `modality`: its configuration; none:
    it has no such endpoint. Questions for that are not counted."""

    def __init__(self, behaves, afterwards=None, modality=None, port=None):
        self.behaves, self.afterwards, self.count = behaves, afterwards, 0
        self.context = zmq.Context()
        # A router, for a REP socket cannot keep an answer back. It returns the envelope, as a REP socket does.
        self.socket = self.context.socket(zmq.ROUTER)
        if afterwards:  # a message that finds no room waits, and is not dropped
            self.socket.setsockopt(zmq.ROUTER_MANDATORY, 1)
            self.socket.setsockopt(zmq.SNDHWM, 1)
            self.socket.setsockopt(zmq.SNDTIMEO, 1000)
        self.modality = {"error": "Unknown endpoint: get_modality_config"} if modality is None else modality
        self.port = port or self.socket.bind_to_random_port("tcp://127.0.0.1")
        if port:
            self.socket.bind(f"tcp://127.0.0.1:{port}")
        self.url = f"tcp://127.0.0.1:{self.port}"
        self.over = threading.Event()
        self.envelopes = []  # of the questions, the present one's last
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self):
        while not self.over.is_set():
            if not self.socket.poll(20):
                continue
            *envelope, question = self.socket.recv_multipart()
            question = msgpack.unpackb(question, strict_map_key=False)
            if question["endpoint"] == "get_modality_config":
                self.socket.send_multipart([*envelope, msgpack.packb(self.modality)])
                continue
            self.envelopes.append(envelope)
            self.count += 1
            reply = self.behaves(question, self.count)
            if reply is not None:
                self.socket.send_multipart([*envelope, reply])
                if self.afterwards:
                    self.afterwards(envelope)

    def close(self):
        self.over.set()
        self.thread.join()
        self.socket.close(0)
        self.context.term()
