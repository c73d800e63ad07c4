#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: what Takt's policy clients put on the wire means to another implementation of MessagePack what it means here, and what that one
writes is read as it was meant. Method: messages of both protocols through npm's @msgpack/msgpack, both ways; openpi's arrays one way
only, for that library cannot write their keys, which are bytes. Exit code 77: python3-msgpack, node or its packages are not installed
(1 with TAKT_REQUIRE_NODE=1).
"""
import io
import json
import os
import pathlib
import shutil
import subprocess
import sys
import unittest

sys.dont_write_bytecode = True
SOURCE = pathlib.Path(__file__).resolve().parents[2]


def skip(why):
    print(f"SKIPPED: {why}: NO MESSAGEPACK OF OTHERS WAS ASKED")
    sys.exit(1 if os.environ.get("TAKT_REQUIRE_NODE") == "1" else 77)


try:
    import msgpack
    import numpy as np
except ImportError as error:
    skip(error)
if not shutil.which("node") or not (SOURCE / "tests/node/node_modules/@msgpack").is_dir():
    skip("node or its packages are missing: (cd tests/node && npm install)")
sys.path.insert(0, str(SOURCE / "client/python"))
from takt import servers  # noqa: E402


def others(decode=(), encode=()):
    asked = json.dumps({"decode": [message.hex() for message in decode], "encode": list(encode)})
    done = subprocess.run(["node", SOURCE / "tests/node/msgpack_check.mjs"], input=asked, capture_output=True, text=True, check=True, timeout=60)
    answered = json.loads(done.stdout)
    return answered["decoded"], [bytes.fromhex(message) for message in answered["encoded"]]


def npy(values):
    file = io.BytesIO()
    np.save(file, values)
    return file.getvalue()


class Vectors(unittest.TestCase):
    def test_openpis_observation_is_understood(self):
        state, image = np.float32([0.5, -1, 3]), np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
        sent = {"observation/joint_position": state, "observation/image": image, "prompt": "pick up the cup", "count": np.int64(-7),
                "nested": {"list": [1, 2.5, None, True]}}
        ours = msgpack.packb(sent, default=servers._openpi_from)
        (understood,), _ = others(decode=[ours])
        self.assertEqual(understood, {
            "observation/joint_position": {"bin:__ndarray__": True, "bin:data": {"bin": state.tobytes().hex()}, "bin:dtype": "<f4", "bin:shape": [3]},
            "observation/image": {"bin:__ndarray__": True, "bin:data": {"bin": image.tobytes().hex()}, "bin:dtype": "|u1", "bin:shape": [2, 4, 3]},
            "prompt": "pick up the cup", "count": {"bin:__npgeneric__": True, "bin:data": -7, "bin:dtype": "<i8"},
            "nested": {"list": [1, 2.5, None, True]}})

    def test_groots_question_is_understood(self):
        state = np.float32([[0.25, 4]])
        asked = {"endpoint": "get_action", "data": {"observation": {"state.left_arm": state, "annotation": ["wave"]}, "options": None}}
        (understood,), _ = others(decode=[msgpack.packb(asked, default=servers._groot_from)])
        self.assertEqual(understood["data"]["observation"]["state.left_arm"], {"__ndarray_class__": True, "as_npy": {"bin": npy(state).hex()}})
        self.assertEqual(understood["data"]["observation"]["annotation"], ["wave"])
        self.assertEqual(understood["endpoint"], "get_action")

    def test_groots_answer_by_others_is_read(self):
        actions = np.arange(12, dtype=np.float32).reshape(4, 3)
        reply = [{"action.left_arm": {"__ndarray_class__": True, "as_npy": {"bin": npy(actions).hex()}}}, {"latency": 0.125}]
        _, (theirs,) = others(encode=[reply])
        read = msgpack.unpackb(theirs, object_hook=servers._groot_to)
        np.testing.assert_array_equal(read[0]["action.left_arm"], actions)
        self.assertEqual(read[1], {"latency": 0.125})

    def test_every_width_of_number_text_and_list_crosses_both_ways(self):
        edges = [0, 1, 127, 128, 255, 256, 65535, 65536, 2**32 - 1, 2**32, 2**53 - 1]
        numbers = edges + [-edge for edge in edges[1:]] + [-32, -33, -129, -32769, -2**31 - 1, 0.1, -1e300, 5e-324]
        values = [numbers, [None, True, False], ["", "a" * 31, "a" * 32, "ä" * 128, "a" * 65536], [list(range(count)) for count in (15, 16, 65536)],
                  {str(key): key for key in range(17)}]
        understood, theirs = others(decode=[msgpack.packb(value) for value in values], encode=values)
        for value, by_them, of_them in zip(values, understood, theirs):
            self.assertEqual(by_them, value)
            self.assertEqual(msgpack.unpackb(of_them, object_hook=servers._openpi_to), value)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
