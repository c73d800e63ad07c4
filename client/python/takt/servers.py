# SPDX-License-Identifier: Apache-2.0
"""Policies that infer on another machine: clients of openpi's and of GR00T's policy servers.

    from takt import servers

    with takt.connect("robot.yaml", spec) as robot, \\
         servers.OpenPi("ws://gpu:8000", shape=(robot.steps, len(robot.joints)), deadline="300 ms") as server:
        for obs in robot:
            with obs.infer():
                q = server.infer({"observation/joint_position": obs.state[0], "prompt": "pick up the cup"})
            if q is None:
                obs.withhold(server.problem)
            else:
                obs.publish(q=q, source=server.source)

`infer` returns within the deadline: an array of that shape, all finite, or None, with the reason in the log "takt". Without an
answer nothing is published, the reason is told, and the executive's freshness contract does what the robot file says; the age of what is published counts
from the observation, by this machine's clock alone. Neither protocol says which question an answer belongs to: after a missed deadline,
and after any message that was not requested, the connection is given up and made anew, so that a late answer is dropped. An answer that came
before is no answer, and one that took the server longer than it was waited for is another question's.

Needs Debian's python3-msgpack, and python3-websockets (OpenPi; 10.4, Debian 12's, or later) or python3-zmq (Groot). An object belongs to the thread that made it.
"""
import asyncio
import collections
import hashlib
import importlib
import inspect
import io
import itertools
import json
import logging
import math
import operator
import os
import ssl
import threading
import time
from types import ModuleType, TracebackType
from typing import Any, Callable, Deque, Dict, List, Mapping, NoReturn, Optional, Sequence, Tuple, Type, Union
from urllib.parse import urlsplit

import numpy as np
from numpy.typing import NDArray

from takt import _library
from takt._failover import FailOver as FailOver
from takt._quantity import seconds
from takt._refused import Refused

_LARGEST_MESSAGE = 16 << 20  # bytes; an answer is some kilobytes
_LONGEST = 1024  # entries of a list or map; arrays are bytes, and a chunk has 128 steps
_MOST_VALUES = 1 << 16  # of a message, in all its lists and maps: reading it is a part of the deadline
_MOST_SHOWN = 200  # characters of a server's own words
# openpi's server puts what it measured of each answer into it, by a clock of nanoseconds: no two are the same bytes.
_TIMING = "server_timing"
_REMEMBERED = 1024  # such answers, to be known when they come again
_MOST_REPEATS = 8  # of them for one question
_CLOCKS_AGREE = 0.99  # the same duration by two machines' clocks; they differ by less
_CONNECT_S = 10.0
_PAUSE_S = 0.2  # between two connections
_SAY_AGAIN_S, _SAY_NEWS_S = 10.0, 1.0  # the same sentence, another one

_log = logging.getLogger("takt")


class _NoAnswer(Exception):
    """Why there is none, in one sentence's end."""


def _need(module: str, package: str) -> ModuleType:
    try:
        return importlib.import_module(module)
    except ImportError:
        raise Refused(f"takt.servers needs the Python module {module}: sudo apt install {package}") from None


def _shown(value: Any) -> str:
    """What a stranger sent, for one line of a log."""
    text = value[:_MOST_SHOWN] if isinstance(value, str) else str(value) if isinstance(value, (int, float)) else type(value).__name__
    return "".join(c if c.isprintable() else "?" for c in text)


def _kind(name: Any) -> "np.dtype[Any]":
    # Not any that numpy knows: "V" and a number is as many bytes, and a list of kinds is parsed for as long as it is.
    kind = np.dtype(name) if isinstance(name, str) and len(name) <= 16 else None
    if kind is None or kind.kind not in "biuf":
        raise ValueError(f"arrays of {_shown(name)} are not taken")
    return kind


def _shaped(data: bytes, dtype: Any, shape: Any) -> NDArray[Any]:
    if not isinstance(shape, list):
        raise ValueError("an array's shape is a list")
    return np.frombuffer(data, _kind(dtype)).reshape([operator.index(extent) for extent in shape])


def _openpi_from(value: Any) -> Any:
    if isinstance(value, (np.ndarray, np.generic)) and value.dtype.kind in "biuf":
        if isinstance(value, np.generic):
            return {b"__npgeneric__": True, b"data": value.item(), b"dtype": value.dtype.str}
        return {b"__ndarray__": True, b"data": value.tobytes(), b"dtype": value.dtype.str, b"shape": value.shape}
    raise Refused(f"takt.servers: {type(value).__name__} cannot be sent: numbers, text, lists, maps and arrays of numbers can", _library.USAGE)


def _openpi_to(value: Dict[Any, Any]) -> Any:
    if b"__ndarray__" in value:
        return _shaped(value[b"data"], value[b"dtype"], value[b"shape"])
    if b"__npgeneric__" in value:
        return _kind(value[b"dtype"]).type(value[b"data"])
    return value


def _groot_from(value: Any) -> Any:
    if isinstance(value, np.ndarray) and value.dtype.kind in "biufU":
        file = io.BytesIO()
        np.save(file, value, allow_pickle=False)
        return {"__ndarray_class__": True, "as_npy": file.getvalue()}
    return _openpi_from(value)


def _groot_to(value: Dict[Any, Any]) -> Any:
    # Not np.load: it opens archives as well, which hold more than they weigh.
    if "__ndarray_class__" not in value:
        return value
    return np.lib.format.read_array(io.BytesIO(value["as_npy"]), allow_pickle=False)  # type: ignore[no-untyped-call]


class _Server:
    """What both have in common: which answers are taken, and what is said about the others."""

    _SCHEMES: Tuple[str, ...] = ()
    _ACTIONS: Tuple[str, ...] = ()

    def __init__(self, url: str, *, shape: Tuple[int, int], deadline: str, actions: Optional[Sequence[str]]) -> None:
        name = type(self).__name__
        parts = urlsplit(url)
        if parts.scheme == "grpc":
            raise Refused(f"{name}: {url} is LeRobot's server: its messages are pickles, which run whatever code their sender put into them; "
                          "serve the policy by openpi's or GR00T's protocol")
        if parts.scheme not in self._SCHEMES or not parts.hostname:
            raise Refused(f"{name}: {url!r} is no address of a server; write one such as '{self._SCHEMES[0]}://host:port'")
        self._steps, self._width = shape
        self.deadline_s = seconds(deadline, f"{name}: deadline")
        if self.deadline_s <= 0:
            raise Refused(f"{name}: deadline is {deadline}: it has to be longer than nothing", _library.USAGE)
        self._keys = tuple(actions or self._ACTIONS)
        self._msgpack = _need("msgpack", "python3-msgpack")
        self.url = url
        self.problem: str = ""  # why the last infer() had no answer; empty: it had one
        self.metadata: Mapping[str, Any] = {}  # what the server said of itself when it was connected last
        # Why a server with metadata of this hash is not asked; empty: it is. FailOver's word.
        self.refusal: Callable[[str], str] = lambda _: ""
        self._said, self._said_at = "", -math.inf

    @property
    def metadata_hash(self) -> str:
        """Of what the server says of itself, 16 hex digits; empty: it says nothing."""
        if not self.metadata:
            return ""
        text = json.dumps(self.metadata, sort_keys=True, default=lambda value: repr(value))
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    @property
    def source(self) -> str:
        """Which server it is, for `obs.publish(source=...)`: its address, and the hash of what it says of itself."""
        said = self.metadata_hash
        return f"{self.url}, metadata {said}" if said else self.url

    def _admit(self) -> None:
        if why := self.refusal(self.metadata_hash):
            raise _NoAnswer(why)

    def _answer(self, ask: Callable[[], Any]) -> Optional[NDArray[np.float32]]:
        try:
            actions = self._actions(ask())
        except _NoAnswer as why:
            self._say(f"{self.url} {why}")
            return None
        self.problem = ""
        return actions

    def _actions(self, reply: Any) -> NDArray[np.float32]:
        if not isinstance(reply, Mapping):
            raise _NoAnswer("answered without a map of actions")
        parts: List[NDArray[Any]] = []
        for key in self._keys:
            try:
                part = np.asarray(reply.get(key, ()))
            except (ValueError, TypeError):  # rows of different lengths, and what else numpy makes nothing of
                raise _NoAnswer(f"answered `{key}` that is no array") from None
            part = part[0] if part.ndim == 3 and part.shape[0] == 1 else part  # a batch of one
            if part.ndim != 2 or part.dtype.kind not in "biuf" or part.shape[0] < self._steps:
                raise _NoAnswer(f"answered `{key}` of shape {part.shape} and type {part.dtype}; wanted are at least {self._steps} rows of numbers "
                                f"(there is {', '.join(map(_shown, itertools.islice(reply, 8))) or 'nothing'})")
            parts.append(part[:self._steps])
        with np.errstate(over="ignore"):  # what is too large for float32 becomes infinite, and is refused below
            actions: NDArray[np.float32] = np.concatenate(parts, axis=1).astype(np.float32)
        if actions.shape[1] != self._width:
            raise _NoAnswer(f"answered {actions.shape[1]} values per step; the robot has {self._width} joints")
        if not np.isfinite(actions).all():
            raise _NoAnswer("answered with values that are not finite")
        return actions

    def _unpack(self, data: bytes, hook: Callable[[Dict[Any, Any]], Any]) -> Any:
        left = _MOST_VALUES

        def counted(value: Any) -> Any:
            nonlocal left
            left -= 1 + len(value)
            if left < 0:
                raise ValueError(f"more than {_MOST_VALUES} values")
            return value
        try:
            return self._msgpack.unpackb(data, object_hook=lambda value: hook(counted(value)), list_hook=counted, strict_map_key=False,
                                         max_array_len=_LONGEST, max_map_len=_LONGEST)
        except Exception as error:  # whatever the bytes of a stranger cause
            raise _NoAnswer(f"answered with what is no message: {error}") from None

    def _say(self, sentence: str) -> None:
        # A server that has a new error for every question, and a long one, fills no log.
        self.problem = "".join(c if c.isprintable() else "?" for c in sentence[:len(self.url) + _MOST_SHOWN + 160])
        now = time.monotonic()
        if now - self._said_at >= (_SAY_AGAIN_S if self.problem == self._said else _SAY_NEWS_S):
            self._said, self._said_at = self.problem, now
            _log.warning("%s", self.problem)

    def close(self) -> None:
        raise NotImplementedError

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]) -> None:
        self.close()


class OpenPi(_Server):
    """openpi's websocket server: `ws://host:8000`, or `wss://` behind TLS. Connects, and connects again, in a thread of its own.

    `shape`: (steps, joints) of what infer() returns; an answer may have more steps, they are cut. `actions`: the reply's key, or
    keys, joined along the joints. `deadline`: "300 ms"; from infer() to its return. `api_key`: sent as the server wants it.
    `ca_file`: of the signer of a wss:// server's certificate, PEM; only that is believed then, else what the system believes.

    An answer that says how long it took (`server_timing`, as those of openpi's own server do) is known when it comes a second time, and
    passed over; and it is not taken for a question that was asked later than it was begun. A server that answers twice, quickly and anew,
    or says no such thing, is known by the message too many, unless that comes after the next question. One whose metadata have
    `"echo": "KEY"` gets a number under KEY in every observation, and has to answer with it under the same key: whatever is not this
    question's is then known at once. `"prefix": "KEY"` asks for what infer() is given as `prefix`, `"delay": "KEY"` for how many steps
    that has. A server that asks for nothing is sent nothing that it might not know.
    """

    _SCHEMES, _ACTIONS = ("ws", "wss"), ("actions",)

    def __init__(self, url: str, *, shape: Tuple[int, int], deadline: str, actions: Optional[Sequence[str]] = None,
                 api_key: Optional[str] = None, ca_file: Union[str, "os.PathLike[str]", None] = None) -> None:
        super().__init__(url, shape=shape, deadline=deadline, actions=actions)
        self._websockets = _need("websockets", "python3-websockets")
        # websockets 14 made another client of `connect`, which calls the headers by another name.
        known = inspect.signature(self._websockets.connect).parameters
        self._how: Dict[str, Any] = {"additional_headers" if "additional_headers" in known else "extra_headers":
                                     {"Authorization": f"Api-Key {api_key}"} if api_key else {}}
        if ca_file is not None:
            self._how["ssl"] = self._trusting(ca_file)
        self._asked = 0
        self._heard: Deque[int] = collections.deque(maxlen=_REMEMBERED)
        self._repeats = 0  # that came since the question
        self._lost = "is not connected yet"
        self._given_up = False  # by us, for the reason in _lost
        self._closing = False
        self._socket: Any = None
        self._pending: Optional["asyncio.Future[Any]"] = None
        self._loop = asyncio.new_event_loop()
        self._keeper = self._loop.create_task(self._keep_connected())
        self._thread = threading.Thread(target=self._loop.run_forever, name="openpi", daemon=True)
        self._thread.start()

    def _trusting(self, ca_file: Union[str, "os.PathLike[str]"]) -> ssl.SSLContext:
        if not self.url.startswith("wss:"):
            raise Refused(f"OpenPi: ca_file is for a server at wss://, not for {self.url}", _library.USAGE)
        try:
            return ssl.create_default_context(cafile=ca_file)
        except OSError as error:
            raise Refused(f"OpenPi: ca_file {os.fspath(ca_file)} is no file of certificates in PEM: {error.strerror or error}") from None

    def __enter__(self) -> "OpenPi":
        return self

    @property
    def connected(self) -> bool:
        """The server has said what it is, and nothing is known against it since."""
        return self._socket is not None

    def infer(self, observation: Mapping[str, Any], *, prefix: Optional[NDArray[np.float32]] = None) -> Optional[NDArray[np.float32]]:
        """The server's actions, (steps, joints), float32, all finite; or None. `observation`: text keys; numbers, text and arrays
        of numbers (numpy) as values, under the names that the policy was trained with. `prefix`: (count, joints), what is played
        whatever the answer, as `obs.committed` has it; sent where the server's metadata ask for it.
        """
        return self._answer(lambda: asyncio.run_coroutine_threadsafe(self._ask(dict(observation), prefix), self._loop).result())

    def close(self) -> None:
        """Ends the connection. A second time does nothing."""
        if self._thread.is_alive():
            self._closing = True  # the library swallows a cancellation that comes while a connection closes
            self._loop.call_soon_threadsafe(self._keeper.cancel)
            asyncio.run_coroutine_threadsafe(self._ended(), self._loop).result()
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join()
            self._loop.close()

    async def _ended(self) -> None:
        await asyncio.wait([self._keeper])

    async def _ask(self, observation: Dict[str, Any], prefix: Optional[NDArray[np.float32]]) -> Any:
        socket = self._socket
        if socket is None:
            raise _NoAnswer(self._lost)
        self._admit()
        self._asked += 1
        self._repeats = 0
        echo = self.metadata.get("echo")
        extra: Dict[str, Any] = {"echo": self._asked}
        if prefix is not None:
            extra.update(prefix=np.ascontiguousarray(prefix, np.float32), delay=len(prefix))
        for name, value in extra.items():
            if isinstance(key := self.metadata.get(name), str):
                observation[key] = value
        question = self._msgpack.packb(observation, default=_openpi_from)
        self._pending = self._loop.create_future()
        try:
            return await asyncio.wait_for(self._exchange(socket, question, echo), self.deadline_s)
        except asyncio.TimeoutError:
            self._give_up(socket, f"did not answer within {self.deadline_s * 1e3:g} ms" + (", but sent an earlier answer again" if self._repeats else ""))
        except _NoAnswer as why:
            self._give_up(socket, str(why))
        except self._websockets.exceptions.ConnectionClosed as why:
            self._give_up(socket, f"closed the connection: {why}")
        finally:
            if self._pending.done() and not self._pending.cancelled():
                self._pending.exception()  # it was not read yet where sending failed as well
            self._pending = None

    async def _exchange(self, socket: Any, question: bytes, echo: Any) -> Any:
        assert self._pending is not None
        asked_at = time.monotonic()
        await socket.send(question)
        message = await self._pending
        waited_ms = 1e3 * (time.monotonic() - asked_at)
        if isinstance(message, str):
            raise _NoAnswer(f"has an error: {(message[-_MOST_SHOWN:].strip().splitlines() or ['of no words'])[-1]}")
        reply = self._unpack(message, _openpi_to)
        if isinstance(echo, str):
            if not isinstance(reply, Mapping) or reply.get(echo) != self._asked:
                raise _NoAnswer("answered another question")
        elif waited_ms < _CLOCKS_AGREE * (inferred_ms := self._inferred_ms(reply)):
            raise _NoAnswer(f"answered another question: it inferred for {inferred_ms:.1f} ms, this one was asked {waited_ms:.1f} ms ago")
        return reply

    def _inferred_ms(self, reply: Any) -> float:
        """How long the server says that it worked for this answer; 0: it does not say, or what cannot be, as when its clock jumped."""
        timing = reply.get(_TIMING) if isinstance(reply, Mapping) else None
        took = timing.get("infer_ms") if isinstance(timing, Mapping) else None
        # No question of this connection was waited for any longer.
        return took if isinstance(took, (int, float)) and 0 < took <= 1e3 * self.deadline_s else 0.0

    def _give_up(self, socket: Any, why: str) -> NoReturn:
        if self._socket is socket:
            self._lost, self._socket, self._given_up = why, None, True
        if socket.transport is not None:
            socket.transport.abort()
        raise _NoAnswer(why)

    async def _keep_connected(self) -> None:
        while not self._closing:
            try:
                # Its pings are answered; none of ours, for a server that infers answers none. The deadline finds who is gone.
                async with self._websockets.connect(self.url, compression=None, max_size=_LARGEST_MESSAGE, max_queue=1, ping_interval=None,
                                                    open_timeout=_CONNECT_S, close_timeout=1, **self._how) as socket:
                    await self._listen(socket)
                self._lose("closed the connection")
            except _NoAnswer as why:
                self._lose(str(why))
            except self._websockets.exceptions.ConnectionClosed as why:
                self._lose(f"closed the connection: {why}")
            except ssl.SSLCertVerificationError as error:
                self._lose(f"shows a certificate that is not believed: {error.verify_message}; `ca_file` names whoever signed it")
            except Exception as error:  # of a network, or of a stranger at its other end
                self._lose(f"cannot be talked to: {error or type(error).__name__}")
            await asyncio.sleep(_PAUSE_S)

    def _lose(self, why: str) -> None:
        if not self._given_up:
            self._lost = why
        self._socket, self._given_up = None, False
        if self._pending is not None and not self._pending.done():
            self._pending.set_exception(_NoAnswer(self._lost))

    async def _listen(self, socket: Any) -> None:
        said = await asyncio.wait_for(socket.recv(), _CONNECT_S)
        metadata = self._unpack(said, _openpi_to) if isinstance(said, bytes) else None
        if not isinstance(metadata, Mapping):
            raise _NoAnswer("is no openpi server: it does not begin with a map of its metadata")
        self.metadata, self._socket = metadata, socket
        async for message in socket:
            if isinstance(message, bytes) and _TIMING.encode() in message:
                if hash(message) in self._heard:
                    self._pass_over_repeat(socket)
                    continue
                self._heard.append(hash(message))
            if self._pending is None or self._pending.done():
                self._give_up(socket, "sent a message that nobody asked for")
            self._pending.set_result(message)

    def _pass_over_repeat(self, socket: Any) -> None:
        self._repeats += 1
        if self._repeats > _MOST_REPEATS:
            self._give_up(socket, "sends an earlier answer again and again")


class Groot(_Server):
    """GR00T's ZeroMQ server: `tcp://host:5555`. `shape`, `deadline` as for OpenPi; `actions`: the keys of the answer, such as
    ("action.left_arm", "action.left_hand"), joined along the joints in this order.
    """

    _SCHEMES = ("tcp",)

    def __init__(self, url: str, *, shape: Tuple[int, int], deadline: str, actions: Sequence[str], api_token: Optional[str] = None) -> None:
        super().__init__(url, shape=shape, deadline=deadline, actions=actions)
        self._zmq = _need("zmq", "python3-zmq")
        self._token = {"api_token": api_token} if api_token else {}
        self._context = self._zmq.Context()
        self._socket: Any = None
        self._lost: Any = None  # says when the server went: another may answer at its address then
        self._is_known = False  # it was asked what it is

    def __enter__(self) -> "Groot":
        return self

    def infer(self, observation: Mapping[str, Any], options: Optional[Mapping[str, Any]] = None) -> Optional[NDArray[np.float32]]:
        """The server's actions, (steps, joints), float32, all finite; or None. `observation` and `options`: as the model's modality
        configuration names them; a batch of one is taken off the answer.
        """
        return self._answer(lambda: self._first(self._ask("get_action", {"observation": dict(observation), "options": dict(options or {})})))

    def reset(self) -> bool:
        """Tells the server to forget what it remembers (`if obs.reset: server.reset()`). False: no answer, see `problem`."""
        try:
            self._ask("reset", {"options": {}})
        except _NoAnswer as why:
            self._say(f"{self.url} {why}")
            return False
        return True

    def close(self) -> None:
        """Ends the connection. A second time does nothing."""
        self._drop()
        self._context.term()

    def _first(self, reply: Any) -> Any:
        return reply[0] if isinstance(reply, (list, tuple)) and reply else reply  # [actions, info]

    def _ask(self, endpoint: str, data: Mapping[str, Any]) -> Any:
        question = self._msgpack.packb({"endpoint": endpoint, "data": data, **self._token}, default=_groot_from)
        until = time.monotonic() + self.deadline_s
        if self._lost is not None and self._lost.poll(0):
            self._drop()
        socket = self._socket = self._socket or self._opened()
        try:
            if not self._is_known:
                self._learn(socket, until)
            self._admit()
            reply = self._exchange(socket, question, until)
        except self._zmq.Again:
            self._drop()  # a late answer finds no reader
            raise _NoAnswer(f"did not answer within {self.deadline_s * 1e3:g} ms") from None
        except self._zmq.ZMQError as error:
            self._drop()
            raise _NoAnswer(f"cannot be talked to: {error}") from None
        if isinstance(reply, Mapping) and "error" in reply:
            raise _NoAnswer(f"has an error: {_shown(reply['error'])}")
        return reply

    def _exchange(self, socket: Any, question: bytes, until: float) -> Any:
        socket.SNDTIMEO = max(1, math.ceil(1e3 * (until - time.monotonic())))
        socket.send(question)
        socket.RCVTIMEO = max(1, math.ceil(1e3 * (until - time.monotonic())))
        return self._unpack(socket.recv(), _groot_to)

    def _learn(self, socket: Any, until: float) -> None:
        """The protocol has no metadata: what a server says of itself is its modality configuration, if it has that endpoint."""
        said = self._exchange(socket, self._msgpack.packb({"endpoint": "get_modality_config", "data": {}, **self._token}), until)
        self.metadata = said if isinstance(said, Mapping) and "error" not in said else {}
        self._is_known = True

    def _opened(self) -> Any:
        socket = self._context.socket(self._zmq.REQ)
        socket.setsockopt(self._zmq.LINGER, 0)
        socket.setsockopt(self._zmq.IMMEDIATE, 1)  # no question waits for a server that is not there
        socket.setsockopt(self._zmq.MAXMSGSIZE, _LARGEST_MESSAGE)
        socket.setsockopt(self._zmq.RCVHWM, _MOST_REPEATS)  # what was not requested waits at its sender
        socket.setsockopt(self._zmq.REQ_CORRELATE, 1)  # a number in the envelope, which every REP socket returns: no other's answer is taken
        self._lost = socket.get_monitor_socket(self._zmq.EVENT_DISCONNECTED)
        socket.connect(self.url)
        return socket

    def _drop(self) -> None:
        if self._socket is not None:
            self._socket.disable_monitor()
            self._lost.close(0)
            self._socket.close()
            self._socket = self._lost = None
        self._is_known = False
