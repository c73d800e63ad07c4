#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: whatever a policy server does, infer() returns in its time with the answer to this very question, or with None and the reason;
never with another's; and once the server behaves, it answers again. Method: servers of one misbehaviour each, openpi's with
python3-websockets and GR00T's with python3-zmq; a good answer repeats the question's number in every value. Exit code 77: those are not installed.
"""
import inspect
import pathlib
import shutil
import socket
import ssl
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from unittest import mock

sys.dont_write_bytecode = True
try:
    import msgpack
    import websockets
    import zmq
    from groot_server import GrootServer, npy
    from openpi_server import JOINTS, STEPS, OpenPiServer, answer, array, well
except ImportError as error:
    print(f"SKIPPED: {error}: NO POLICY SERVER WAS TALKED TO")
    sys.exit(77)
import numpy as np
from wire import Wire

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "client/python"))
import takt  # noqa: E402
from takt import servers  # noqa: E402

PATIENCE_S = 20


class RawServer:
    """A TCP port; `behaves(connection)` per connection, on a thread."""

    def __init__(self, behaves):
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = "ws://127.0.0.1:%d" % self.listener.getsockname()[1]
        self.behaves, self.over = behaves, threading.Event()
        self.thread = threading.Thread(target=self._run)
        self.thread.start()

    def _run(self):
        while not self.over.is_set():
            try:
                connection, _ = self.listener.accept()
            except OSError:
                return
            with connection:
                try:
                    self.behaves(connection, self.over)
                except OSError:
                    pass

    def close(self):
        self.over.set()
        self.listener.shutdown(socket.SHUT_RDWR)
        self.listener.close()
        self.thread.join()


class Asking(unittest.TestCase):
    def open(self, server, **more):
        self.addCleanup(server.close)
        client = servers.OpenPi(server.url, shape=(STEPS, JOINTS), deadline=more.pop("deadline", "300 ms"), **more)
        self.addCleanup(client.close)
        return client

    def ask(self, client, number):
        """What came back is this question's, or nothing with a reason."""
        values = client.infer({"n": number, "state": np.zeros(3, np.float32)})
        if values is None:
            self.assertIn(client.url, client.problem)
        else:
            self.assertEqual(client.problem, "")
            self.assertEqual(values.shape, (STEPS, JOINTS))
            self.assertTrue((values == number).all(), f"asked {number}, got {values[0, 0]}")
        return values

    def until(self, client, wanted, first=1):
        """Asks until `wanted(values, problem)`; returns the next number."""
        end = time.monotonic() + PATIENCE_S
        for number in range(first, 1 << 30):
            values = self.ask(client, number)
            if wanted(values, client.problem):
                return number + 1
            self.assertLess(time.monotonic(), end, f"last: {client.problem or 'an answer'}")
            if not getattr(client, "connected", True):
                time.sleep(0.01)

    def good(self, values, _problem):
        return values is not None

    def says(self, *words):
        return lambda _values, problem: any(one in problem for one in words)


class OpenPi(Asking):
    def test_bytes_are_openpis(self):
        # One float32, and the order of the keys, as openpi-client writes them.
        wanted = bytes.fromhex("84c40b5f5f6e6461727261795f5fc3c40464617461c4040000803fc4056474797065a33c6634c40573686170659101")
        self.assertEqual(msgpack.packb(np.float32([1.0]), default=servers._openpi_from), wanted)
        self.assertEqual(msgpack.unpackb(wanted, object_hook=servers._openpi_to), np.float32([1.0]))
        scalar = msgpack.packb(np.float32(2.5), default=servers._openpi_from)
        self.assertEqual(msgpack.unpackb(scalar, object_hook=servers._openpi_to), np.float32(2.5))
        for values in (np.arange(6, dtype=np.uint8).reshape(1, 2, 3), np.array([True]), np.array([-1], np.int64), np.zeros((0, 2))):
            there = msgpack.unpackb(msgpack.packb(values, default=servers._openpi_from), object_hook=servers._openpi_to)
            np.testing.assert_array_equal(there, values)
            self.assertEqual(there.dtype, values.dtype)

    def test_answers_are_those_of_their_questions(self):
        client = self.open(OpenPiServer(), api_key="secret")
        number = self.until(client, self.good)
        for more in range(50):
            self.assertIsNotNone(self.ask(client, number + more))
        self.assertEqual(client.metadata, {"reset": None})

    def test_the_key_is_sent_by_the_client_of_any_version(self):
        """A stand-in for `connect` with the signature of each of the library's two clients, over the one that is installed."""
        real = websockets.connect
        ours = "additional_headers" if "additional_headers" in inspect.signature(real).parameters else "extra_headers"

        def until_13(uri, *, compression="deflate", extra_headers=None, open_timeout=10, ping_interval=20, close_timeout=10, max_size=2**20, max_queue=2**5):
            return real(uri, compression=compression, open_timeout=open_timeout, ping_interval=ping_interval, close_timeout=close_timeout, max_size=max_size,
                        max_queue=max_queue, **{ours: extra_headers})

        def from_14(uri, *, compression="deflate", additional_headers=None, proxy=True, open_timeout=10, ping_interval=20, close_timeout=10, max_size=2**20,
                    max_queue=16):
            return until_13(uri, compression=compression, extra_headers=additional_headers, open_timeout=open_timeout, ping_interval=ping_interval,
                            close_timeout=close_timeout, max_size=max_size, max_queue=max_queue)
        for connect in (until_13, from_14):
            with self.subTest(connect.__name__), mock.patch("websockets.connect", connect):
                server = OpenPiServer()
                client = self.open(server, api_key="secret")
                self.until(client, self.good)
                self.assertEqual(server.headers["Authorization"], "Api-Key secret")

    def misbehaves(self, behaves, *said):
        """Twice misbehaviour, told as `said`; then a server that behaves is believed again."""
        async def twice(peer, asked, count):
            await (behaves if count <= 2 else well)(peer, asked, count)
        server = OpenPiServer(twice)
        client = self.open(server)
        number = self.until(client, self.says(*said))
        self.until(client, self.good, number)
        return server

    def test_silence_ends_with_the_deadline(self):
        async def never(peer, asked, count):
            pass
        self.misbehaves(never, "did not answer within 300 ms")

    def test_a_late_answer_is_nobodys(self):
        asked_before = []

        async def late(peer, asked, count):
            for before, number in asked_before:
                try:
                    await before.send(answer(number))
                except websockets.ConnectionClosed:
                    pass
            if count > 2:
                await well(peer, asked, count)
            else:
                asked_before.append((peer, asked["n"]))
        server = OpenPiServer(late)
        client = self.open(server)
        number = self.until(client, self.says("did not answer"))
        for _ in range(5):
            number = self.until(client, self.good, number)
        self.assertEqual(server.connections, 3, "every question without an answer had a connection of its own")

    def test_a_partition_of_five_seconds_leaves_no_answer_of_before(self):
        wire = Wire(OpenPiServer())
        client = self.open(wire)
        number = self.until(client, self.good)
        wire.whole.clear()
        number = self.until(client, self.says("did not answer", "connected"), number)
        healed = time.monotonic() + 5
        while time.monotonic() < healed:  # every answer that comes is checked to be this question's
            self.ask(client, number)
            number += 1
        wire.whole.set()
        for _ in range(5):
            number = self.until(client, self.good, number)

    def test_a_server_that_stalls_for_five_seconds_answers_nobody_afterwards(self):
        async def stalls(peer, asked, count):
            if count == 3:
                time.sleep(5)  # the whole server: what was asked meanwhile is read and answered late
            await well(peer, asked, count)
        client = self.open(OpenPiServer(stalls))
        number = self.until(client, self.says("did not answer"))
        for _ in range(5):
            number = self.until(client, self.good, number)

    def test_clocks_that_jump_change_nothing(self):
        async def from_another_time(peer, asked, count):
            times = (-1e18, 1e18, float("nan"))[count % 3]
            await peer.send(answer(asked["n"], policy_timing={"infer_ms": times}, server_timing={"infer_ms": times, "prev_total_ms": times}))
        client = self.open(OpenPiServer(from_another_time))
        number, today = self.until(client, self.good), time.time()
        for jump in (-3e7, 3e7, -1e9) * 4:
            with mock.patch("time.time", return_value=today + jump), mock.patch("time.time_ns", return_value=int(today + jump) * 10**9):
                self.assertIsNotNone(self.ask(client, number), client.problem)
            number += 1

    def test_a_server_that_echoes_cannot_mix_answers_up(self):
        metadata = msgpack.packb({"echo": "question"})
        sent = []

        async def mixed_up(peer, asked, count):
            sent.append(asked)
            with_number = sent[-2] if count % 3 == 0 and len(sent) > 1 else asked
            await peer.send(answer(with_number["n"], question=with_number["question"]))
            if count % 4 == 0:
                await peer.send(answer(asked["n"], question=asked["question"]))
        client = self.open(OpenPiServer(mixed_up, metadata=metadata))
        number = self.until(client, self.says("answered another question"))
        for _ in range(5):
            number = self.until(client, self.good, number)

    def test_a_server_gets_what_it_asks_for_and_no_other_key(self):
        prefix = np.arange(2 * JOINTS, dtype=np.float64).reshape(2, JOINTS)
        for metadata, wanted in (({}, {"n"}), ({"prefix": 3}, {"n"}), ({"prefix": "held", "delay": "d"}, {"n", "held", "d"})):
            seen = []

            async def listens(peer, asked, count):
                seen.append(asked)
                await peer.send(answer(asked["n"], server_timing={"infer_ms": 1e-3 * count}))
            client = self.open(OpenPiServer(listens, metadata=msgpack.packb(metadata)))
            self.until(client, self.good)
            seen.clear()
            for actions in (client.infer({"n": 7}, prefix=prefix), servers.FailOver(client).infer({"n": 7}, prefix=prefix)):
                self.assertIsNotNone(actions, client.problem)
            for asked in seen:
                self.assertEqual(set(asked), wanted)
            if "held" in wanted:
                held = seen[-1]["held"]
                self.assertEqual((held[b"dtype"], held[b"shape"], seen[-1]["d"]), ("<f4", [2, JOINTS], 2))
                self.assertEqual(held[b"data"], prefix.astype("<f4").tobytes())

    def test_an_error_in_words_is_told(self):
        async def text(peer, asked, count):
            await peer.send("Traceback (most recent call last):\n  File x\nKeyError: 'prompt'\n")
            await peer.close(1011, "Internal server error")
        self.misbehaves(text, "has an error: KeyError: 'prompt'")

    def test_a_close_in_the_middle_is_told_and_mended(self):
        async def close(peer, asked, count):
            await peer.close(1011, "out of memory")
        self.assertGreaterEqual(self.misbehaves(close, "closed the connection").connections, 2)

    def test_actions_of_another_robot_are_not_taken(self):
        for reply, said in ((lambda n: answer(n, width=8), "8 values per step; the robot has 3 joints"),
                            (lambda n: answer(n, steps=2), "`actions` of shape (2, 3)"),
                            (lambda n: answer(float("nan")), "not finite"),
                            (lambda n: answer(float("inf")), "not finite"),
                            (lambda n: msgpack.packb({"error": 3}), "`actions` of shape (0,)"),
                            (lambda n: msgpack.packb({"actions": "up"}), "`actions` of shape ()"),
                            (lambda n: msgpack.packb([1, 2]), "without a map of actions"),
                            (lambda n: b"\xc1\xff", "what is no message"),
                            (lambda n: msgpack.packb({"actions": array([1], dtype="|O")}), "what is no message"),
                            (lambda n: msgpack.packb({"actions": array([1], shape=[1 << 28, 3])}), "what is no message"),
                            (lambda n: msgpack.packb({"actions": [[1, 2], [3]]}), "`actions` that is no array"),
                            (lambda n: msgpack.packb({"actions": {b"__npgeneric__": True, b"dtype": "V268435456", b"data": 1}}), "what is no message"),
                            (lambda n: msgpack.packb({"actions": array([1], shape="1")}), "what is no message"),
                            (lambda n: b"\xdd\x7f\xff\xff\xff", "what is no message"),
                            (lambda n: b"\xdd\x00\x20\x00\x00" + b"\x80" * (2 << 20), "what is no message"),
                            (lambda n: b"\xdc\x04\x00" + (b"\xdc\x04\x00" + b"\x80" * 1024) * 1024, "what is no message"),
                            (lambda n: b"\x91" * 2000 + b"\xc0", "what is no message")):
            with self.subTest(said):
                async def wrong(peer, asked, count):
                    await peer.send(reply(asked["n"]))
                self.misbehaves(wrong, said)

    def test_values_without_end_are_not_read_to_their_end(self):
        # Lists in lists, each as long as one may be: 16 million maps in 16 MiB. They are counted, and the count ends the reading.
        read = 0

        def counts(value):
            nonlocal read
            read += 1
            return value
        client = servers.OpenPi("ws://127.0.0.1:1", shape=(STEPS, JOINTS), deadline="300 ms")
        self.addCleanup(client.close)
        row = b"\xdc\x04\x00" + b"\x80" * 1024
        nested = b"\xdc\x04\x00" + row * 1024
        with self.assertRaisesRegex(servers._NoAnswer, "no message"):
            client._unpack(b"\x9f" + nested * 15, counts)
        self.assertLessEqual(read, servers._MOST_VALUES)
        self.assertGreater(read, 0)

    def test_a_server_cannot_fill_the_log(self):
        # Each answer is an error of its own, of a megabyte and with what moves a terminal's cursor.
        async def errors(peer, asked, count):
            words = "\x1b[2J\n" + f"error {count} " + "e" * (1 << 20)
            await peer.send((words, msgpack.packb({words: 1}), b"\xc1")[count % 3])
        client = self.open(OpenPiServer(errors))
        with self.assertLogs("takt", "WARNING") as log:
            seen, begin = set(), time.monotonic()
            for number in range(1, 1 << 30):
                self.assertIsNone(self.ask(client, number))
                if "connected" not in client.problem and "closed" not in client.problem:
                    seen.add(client.problem)
                self.assertLess(len(client.problem), 500)
                self.assertTrue(client.problem.isprintable(), client.problem[:200])
                if len(seen) >= 6:
                    break
                self.assertLess(time.monotonic(), begin + PATIENCE_S, seen)
                time.sleep(0.01)
            elapsed = time.monotonic() - begin
        self.assertLessEqual(len(log.output), 1 + elapsed / servers._SAY_NEWS_S, log.output)

    def test_a_giant_is_cut_off(self):
        async def giant(peer, asked, count):
            await peer.send(bytes(servers._LARGEST_MESSAGE + 1))
        self.misbehaves(giant, "1009", "did not answer")  # how soon the connection ends depends on the machine

    def test_what_nobody_asked_for_ends_the_connection(self):
        async def and_again(peer, asked, count):
            await peer.send(answer(asked["n"]))
            await peer.send(answer(asked["n"]))
        server = OpenPiServer(and_again)
        client = self.open(server)
        number = self.until(client, self.good)
        end = time.monotonic() + PATIENCE_S
        while client.connected:  # nothing is asked meanwhile: the answer too many comes by itself
            self.assertLess(time.monotonic(), end)
            time.sleep(0.005)
        server.behaves = well
        self.until(client, self.good, number)

    def test_an_answer_that_comes_again_is_passed_over(self):
        # At once, and after the next question, whose answer it is not.
        sent = []

        async def again(peer, asked, count):
            if sent:
                await peer.send(sent[-1])
            sent.append(answer(asked["n"]))
            await peer.send(sent[-1])
            await peer.send(sent[-1])
        server = OpenPiServer(again)
        client = self.open(server, deadline="10 s")
        number = self.until(client, self.good)
        for more in range(20):
            self.assertIsNotNone(self.ask(client, number + more), client.problem)
        self.assertEqual(server.connections, 1)

    def test_an_old_answer_in_the_place_of_a_new_one_is_none(self):
        first = []

        async def old(peer, asked, count):
            first.append(answer(asked["n"]))
            await peer.send(first[0])
        self.until(self.open(OpenPiServer(old)), self.says("did not answer within 300 ms, but sent an earlier answer again"))

        async def without_end(peer, asked, count):
            first.append(answer(asked["n"]))
            for _ in range(100):
                await peer.send(first[0])
        first.clear()
        self.until(self.open(OpenPiServer(without_end)), self.says("sends an earlier answer again and again"))

    def test_who_says_the_same_without_a_time_is_believed(self):
        # A policy that holds a pose, on a server that measures nothing: its answers are the same bytes, and each is its question's.
        async def constant(peer, asked, count):
            await peer.send(msgpack.packb({"actions": array(np.full((STEPS, JOINTS), 7))}))
        server = OpenPiServer(constant)
        client = self.open(server, deadline="10 s")
        end = time.monotonic() + PATIENCE_S
        while not client.connected:
            self.assertLess(time.monotonic(), end)
            time.sleep(0.005)
        for _ in range(20):
            self.assertIsNotNone(self.ask(client, 7), client.problem)
        self.assertEqual(server.connections, 1)

    def test_what_took_longer_than_it_was_waited_for_is_another_questions(self):
        # Each question is answered twice, and anew; the second comes when the next one is asked.
        second = []

        async def twice(peer, asked, count):
            if second:
                await peer.send(answer(second[-1], server_timing={"infer_ms": 9999.0}))
            second.append(asked["n"])
            await peer.send(answer(asked["n"]))
        client = self.open(OpenPiServer(twice), deadline="10 s")
        number = self.until(client, self.good)
        self.assertIsNone(self.ask(client, number))
        self.assertRegex(client.problem, "answered another question: it inferred for 9999.0 ms, this one was asked .* ms ago")

    def test_who_is_no_openpi_server_is_named(self):
        for metadata in ("hello", b"\x07"):
            with self.subTest(metadata):
                client = self.open(OpenPiServer(metadata=metadata))
                self.until(client, self.says("is no openpi server"))
        client = self.open(OpenPiServer(metadata=None))
        self.until(client, self.says("is not connected yet"))
        client = self.open(RawServer(lambda connection, over: connection.sendall(b"HTTP/1.1 200 OK\r\n\r\n")))
        self.until(client, self.says("cannot be talked to"))

    def test_one_byte_at_a_time_is_no_answer(self):
        def dribbles(connection, over):
            request = b""
            while b"\r\n\r\n" not in request:
                request += connection.recv(4096)
            key = request.lower().split(b"sec-websocket-key: ")[1]
            key = request[len(request) - len(key):].split(b"\r\n")[0].decode()
            import base64
            import hashlib
            accept = base64.b64encode(hashlib.sha1((key + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11").encode()).digest())
            connection.sendall(b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: " + accept
                               + b"\r\n\r\n\x82\x01\x80")  # a frame of one byte: an empty map
            frame = b"\x82\x7e\x7f\xff" + b"\x00" * 100
            for at in range(len(frame)):
                connection.sendall(frame[at:at + 1])
                if over.wait(0.05):
                    return
        self.until(self.open(RawServer(dribbles)), self.says("did not answer within"))

    def test_a_server_that_reads_nothing_blocks_nobody(self):
        async def reads_no_more(peer, asked, count):
            peer.transport.pause_reading()
        client = self.open(OpenPiServer(reads_no_more))
        large = np.zeros(8 << 20, np.uint8)  # more than the sockets' buffers hold
        end = time.monotonic() + PATIENCE_S
        seen = set()
        while len(seen) < 1 or "did not answer" not in "".join(seen):
            self.assertIsNone(client.infer({"n": 0, "image": large}))
            seen.add(client.problem)
            self.assertLess(time.monotonic(), end, seen)

    def test_a_server_may_come_later_and_go_and_come_back(self):
        first = OpenPiServer()
        first.close()
        client = servers.OpenPi(first.url, shape=(STEPS, JOINTS), deadline="300 ms")
        self.addCleanup(client.close)
        number = self.until(client, self.says("cannot be talked to"))
        for _ in range(2):
            server = OpenPiServer(port=first.port)
            number = self.until(client, self.good, number)
            server.close()
            number = self.until(client, self.says(client.url), number)

    def test_a_client_may_be_closed_while_its_connection_is_being_closed(self):
        async def too_many_and_deaf(peer, asked, count):
            await peer.send(answer(asked["n"]))
            await peer.send(answer(asked["n"]))
            peer.transport.pause_reading()  # the client's close is not answered
        client = self.open(OpenPiServer(too_many_and_deaf))
        self.until(client, self.good)
        end = time.monotonic() + PATIENCE_S
        while client._socket is not None and client._socket.state.name == "OPEN":
            self.assertLess(time.monotonic(), end)
            time.sleep(0.001)
        closing = threading.Thread(target=client.close, daemon=True)
        closing.start()
        closing.join(PATIENCE_S)
        self.assertFalse(closing.is_alive())

    def test_a_server_behind_tls_is_believed_by_who_signed_it(self):
        if not shutil.which("openssl"):
            self.skipTest("NO SERVER BEHIND TLS WAS TALKED TO: openssl is not installed")
        folder = pathlib.Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, folder)
        certificate, key = folder / "certificate.pem", folder / "key.pem"
        subprocess.run(["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=test", "-addext", "subjectAltName=IP:127.0.0.1",
                        "-keyout", key, "-out", certificate], check=True, capture_output=True)
        tls = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        tls.load_cert_chain(certificate, key)
        server = OpenPiServer(tls=tls)
        self.until(self.open(server), self.says("shows a certificate that is not believed: self-signed certificate; `ca_file` names whoever signed it"))
        client = self.open(server, ca_file=certificate)
        number = self.until(client, self.good)
        for more in range(20):
            self.assertIsNotNone(self.ask(client, number + more), client.problem)
        for url, file, said in ((server.url, folder / "none.pem", "none.pem is no file of certificates in PEM: No such file"),
                                (server.url, key, "is no file of certificates in PEM"), ("ws://127.0.0.1:1", certificate, "ca_file is for a server at wss://")):
            with self.subTest(said), self.assertRaisesRegex(takt.Refused, said):
                servers.OpenPi(url, shape=(STEPS, JOINTS), deadline="1 s", ca_file=file)

    def test_what_cannot_be_meant_is_refused_in_a_sentence(self):
        fine = {"url": "ws://127.0.0.1:1", "shape": (STEPS, JOINTS), "deadline": "1 s"}
        for change, said in (({"url": "grpc://gpu:8080"}, "pickles"), ({"url": "http://gpu"}, "is no address of a server"), ({"url": "ws://"}, "is no address"),
                             ({"deadline": "1"}, "is no time"), ({"deadline": "0 s"}, "longer than nothing")):
            with self.subTest(said), self.assertRaisesRegex(takt.Refused, said):
                servers.OpenPi(**{**fine, **change})
        client = servers.OpenPi(**fine)
        client.close()
        client.close()
        with OpenPiClosing() as (client, number), self.assertRaisesRegex(takt.Refused, "object cannot be sent"):
            client.infer({"n": number, "x": object()})


class FailOver(Asking):
    def both(self, behaves):
        """Two servers, of which the first behaves so."""
        first, second = OpenPiServer(behaves), OpenPiServer()
        client = servers.FailOver(self.open(first), self.open(second))
        self.addCleanup(client.close)
        end = time.monotonic() + PATIENCE_S
        while not all(server.connected for server in client.servers):
            self.assertLess(time.monotonic(), end)
            time.sleep(0.005)
        return first, second, client

    def ask(self, client, number):
        """What came back is this question's, or nothing with a reason."""
        values = client.infer({"n": number})
        self.assertEqual(values is None, bool(client.problem))
        self.assertTrue(values is None or (values == number).all())
        return values

    def test_one_answers_in_the_place_of_another_and_goes_on(self):
        async def never(peer, asked, count):
            pass
        first, second, client = self.both(never)
        with self.assertLogs("takt", "WARNING") as log:
            number = self.until(client, self.good)
        self.assertTrue(any(f"{second.url} answers in the place of {first.url}" in line for line in log.output), log.output)
        asked = first.questions
        missed = sum(self.ask(client, number + more) is None for more in range(20))
        self.assertLessEqual(first.questions - asked, missed, "it is asked when the other has no answer, and else never")

    def test_who_goes_leaves_no_question_without_an_answer(self):
        first, second, client = self.both(well)
        number = self.until(client, self.good)
        self.assertEqual(second.questions, 0)
        first.close()
        end = time.monotonic() + PATIENCE_S
        while client.servers[0].connected:
            self.assertLess(time.monotonic(), end)
            time.sleep(0.005)
        self.until(client, self.good, number)
        self.assertGreater(second.questions, 0)

    def test_without_any_there_is_no_answer_but_a_reason(self):
        first, second, client = self.both(well)
        first.close()
        second.close()
        self.until(client, lambda values, problem: values is None and "127.0.0.1" in problem)
        with self.assertRaisesRegex(takt.Refused, "name the servers"):
            servers.FailOver()
        with self.assertRaisesRegex(takt.Refused, "accepted is a list of metadata hashes"):
            servers.FailOver(*client.servers, accepted="0123456789abcdef")

    def of_two_policies(self, **more):
        """Two servers whose metadata differ, both connected; the first answers `number`, and leaves."""
        first, second = OpenPiServer(metadata=msgpack.packb({"checkpoint": "a"})), OpenPiServer(metadata=msgpack.packb({"checkpoint": "b"}))
        clients = self.open(first), self.open(second)
        end = time.monotonic() + PATIENCE_S
        while not all(client.connected for client in clients):
            self.assertLess(time.monotonic(), end)
            time.sleep(0.005)
        hashes = [client.metadata_hash for client in clients]
        self.assertEqual(len({*hashes, ""}), 3, "each has a hash of its own")
        client = servers.FailOver(*clients, **{key: [hashes[i] for i in value] for key, value in more.items()})
        self.addCleanup(client.close)
        number = self.until(client, lambda values, problem: values is not None or "is not asked" in problem)
        answered = client.source
        first.close()
        end = time.monotonic() + PATIENCE_S
        while clients[0].connected:
            self.assertLess(time.monotonic(), end)
            time.sleep(0.005)
        return first, second, client, hashes, number, answered

    def test_another_policy_is_not_asked(self):
        first, second, client, hashes, number, answered = self.of_two_policies()
        self.assertEqual(answered, f"{first.url}, metadata {hashes[0]}")
        self.assertIsNone(self.ask(client, number))
        self.assertIn(f"{second.url} is not asked: it has metadata {hashes[1]}, not {hashes[0]}", client.problem)
        self.assertIn(first.url, client.problem, "and why the first one has no answer")
        self.assertEqual(second.questions, 0)

    def test_a_listed_policy_is_asked(self):
        _, second, client, hashes, number, _ = self.of_two_policies(accepted=[0, 1])
        self.until(client, self.good, number)
        self.assertEqual(client.source, f"{second.url}, metadata {hashes[1]}")

    def test_a_list_holds_for_the_first_one_too(self):
        first, second, client, hashes, number, answered = self.of_two_policies(accepted=[1])
        self.until(client, self.good, number)
        self.assertEqual(answered, f"{second.url}, metadata {hashes[1]}")
        self.assertEqual(first.questions, 0)


class OpenPiClosing:
    """A client that is connected."""

    def __enter__(self):
        self.server = OpenPiServer()
        self.client = servers.OpenPi(self.server.url, shape=(STEPS, JOINTS), deadline="300 ms")
        end = time.monotonic() + PATIENCE_S
        while not self.client.connected and time.monotonic() < end:
            time.sleep(0.005)
        return self.client, 1

    def __exit__(self, *error):
        self.client.close()
        self.server.close()


class Groot(Asking):
    @staticmethod
    def well(asked, count=0, arm=2, hand=1, dtype=np.float32, **how):
        number = asked["data"]["observation"]["n"]
        return msgpack.packb([{"action.arm": npy(np.full((1, STEPS + 1, arm), number, dtype), **how), "action.hand": npy(np.full((1, STEPS + 1, hand), number, dtype), **how)}, {}])

    @staticmethod
    def zipped(_question):
        import io
        file = io.BytesIO()
        np.savez_compressed(file, np.zeros(1 << 20))
        return msgpack.packb([{"action.arm": {"__ndarray_class__": True, "as_npy": file.getvalue()}}, {}])

    def open(self, server, **more):
        self.addCleanup(server.close)
        client = servers.Groot(server.url, shape=(STEPS, JOINTS), deadline=more.pop("deadline", "300 ms"), actions=("action.arm", "action.hand"), **more)
        self.addCleanup(client.close)
        return client

    def test_answers_are_those_of_their_questions(self):
        asked = []

        def behaves(question, count):
            asked.append(question)
            return msgpack.packb({"status": "ok"}) if question["endpoint"] == "reset" else self.well(question)
        client = self.open(GrootServer(behaves), api_token="secret")
        self.assertTrue(client.reset())
        number = self.until(client, self.good)
        for more in range(20):
            self.assertIsNotNone(self.ask(client, number + more))
        self.assertEqual(asked[1]["endpoint"], "get_action")
        self.assertEqual(asked[1]["api_token"], "secret")
        state = asked[1]["data"]["observation"]["state"]
        self.assertTrue(state["__ndarray_class__"] and state["as_npy"].startswith(b"\x93NUMPY"))

    def test_misbehaviour_is_told_and_ends(self):
        for wrong, said in ((lambda question: None, "did not answer within 300 ms"),
                            (lambda question: msgpack.packb({"error": "no such modality"}), "has an error: no such modality"),
                            (lambda question: msgpack.packb({"error": "\x1b[2J" * (1 << 18)}), "has an error: ?[2J?[2J"),
                            (lambda question: msgpack.packb({"error": [1, {}]}), "has an error: list"),
                            (lambda question: self.zipped(question), "what is no message"),
                            (lambda question: self.well(question, hand=2), "4 values per step"),
                            (lambda question: msgpack.packb([{"action.arm": npy(np.full((1, STEPS, 2), np.nan)), "action.hand": npy(np.zeros((1, STEPS, 1)))}, {}]), "not finite"),
                            (lambda question: msgpack.packb([{}, {}]), "`action.arm` of shape (0,)"),
                            (lambda question: msgpack.packb([]), "without a map of actions"),
                            (lambda question: b"\xc1", "what is no message"),
                            (lambda question: self.well(question, dtype=object), "what is no message"),
                            (lambda question: bytes(servers._LARGEST_MESSAGE + 1), "did not answer within 300 ms")):
            with self.subTest(said):
                client = self.open(GrootServer(lambda question, count: wrong(question) if count <= 2 else self.well(question)))
                number = self.until(client, self.says(said))
                self.until(client, self.good, number)

    def test_a_late_answer_is_nobodys(self):
        server = GrootServer(lambda question, count: None)

        def with_the_old_ones(question, count):
            for envelope in server.envelopes[:-1]:
                server.socket.send_multipart([*envelope, self.well({"data": {"observation": {"n": -1}}})])
            return self.well(question)
        client = self.open(server)
        number = self.until(client, self.says("did not answer"))
        server.behaves = with_the_old_ones
        self.until(client, self.good, number)

    def test_an_answer_that_comes_twice_is_taken_once(self):
        def again(question, count):
            for envelope in server.envelopes[-3:-1]:
                server.socket.send_multipart([*envelope, self.well({"data": {"observation": {"n": -1}}})])
            return self.well(question)
        server = GrootServer(again)
        client = self.open(server, deadline="10 s")
        number = self.until(client, self.good)
        for more in range(20):
            self.assertIsNotNone(self.ask(client, number + more), client.problem)

    def test_a_rep_socket_as_the_real_servers_is_understood(self):
        context = zmq.Context()
        self.addCleanup(context.term)
        socket = context.socket(zmq.REP)
        self.addCleanup(socket.close, 0)
        port, over = socket.bind_to_random_port("tcp://127.0.0.1"), threading.Event()

        def serve():
            while not over.is_set():
                if socket.poll(20):
                    asked = msgpack.unpackb(socket.recv(), strict_map_key=False)
                    socket.send(self.well(asked) if asked["endpoint"] == "get_action" else msgpack.packb({"state": {"delta_indices": [0]}}))
        thread = threading.Thread(target=serve)
        thread.start()
        self.addCleanup(thread.join)
        self.addCleanup(over.set)
        client = servers.Groot(f"tcp://127.0.0.1:{port}", shape=(STEPS, JOINTS), deadline="10 s", actions=("action.arm", "action.hand"))
        self.addCleanup(client.close)
        for number in range(1, 20):
            self.assertIsNotNone(self.ask(client, number), client.problem)
        self.assertRegex(client.source, f"^tcp://127.0.0.1:{port}, metadata [0-9a-f]{{16}}$")

    def test_another_policy_at_its_address_is_not_asked(self):
        # The first server's place is taken between two questions by one that says something else of itself.
        first = GrootServer(lambda question, count: self.well(question), modality={"state": {"modality_keys": ["arm"]}})
        client = servers.FailOver(self.open(first))
        client.url = first.url
        number = self.until(client, self.good)
        first.close()
        second = GrootServer(lambda question, count: self.well(question), modality={"state": {"modality_keys": ["hand"]}}, port=first.port)
        self.addCleanup(second.close)
        self.until(client, lambda values, problem: "is not asked: it has metadata " in problem, number)
        self.assertEqual(second.count, 0)

    def test_what_nobody_asked_for_waits_at_its_sender(self):
        # 200 MiB behind an answer: what this side takes in of them is bounded by messages, not by the sender's patience.
        sent = [0]

        def floods(frames):
            try:
                while sent[0] < 200:
                    server.socket.send_multipart([*frames, bytes(1 << 20)])
                    sent[0] += 1
            except zmq.ZMQError:
                pass
            over.set()
        over = threading.Event()
        server = GrootServer(lambda question, count: self.well(question), floods)
        client = self.open(server)
        self.until(client, self.good)
        self.assertTrue(over.wait(PATIENCE_S))
        self.assertLess(sent[0], 100, "MiB")

    def test_who_is_not_there_is_told(self):
        client = servers.Groot("tcp://127.0.0.1:1", shape=(STEPS, JOINTS), deadline="50 ms", actions=("a",))
        self.addCleanup(client.close)
        self.assertIsNone(self.ask(client, 1))
        self.assertFalse(client.reset())
        with self.assertRaisesRegex(takt.Refused, "is no address"):
            servers.Groot("ws://127.0.0.1:1", shape=(1, 1), deadline="1 s", actions=("a",))


if __name__ == "__main__":
    unittest.main()
