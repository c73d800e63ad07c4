# SPDX-License-Identifier: Apache-2.0
"""Several policy servers in the place of one."""
import logging
import time
from types import TracebackType
from typing import Any, Callable, Collection, List, Mapping, Optional, Protocol, Type

import numpy as np
from numpy.typing import NDArray

from takt import _library
from takt._refused import Refused

_log = logging.getLogger("takt")


class _Server(Protocol):
    url: str
    problem: str
    deadline_s: float
    refusal: Callable[[str], str]

    @property
    def source(self) -> str: ...

    @property
    def infer(self) -> Callable[..., Optional[NDArray[np.float32]]]: ...

    def close(self) -> None: ...


class FailOver:
    """Several servers of one policy: `FailOver(OpenPi("ws://gpu1:8000", ...), OpenPi("ws://gpu2:8000", ...))`, each with the same shape.

    One is asked, and another only when that has no answer; who answered last is asked next. A question whose deadline has passed by half is not
    asked again: the other gets the next one. So infer() takes one and a half deadlines at most. What a server remembers of the questions
    before, the other does not know.

    A server is asked only if its metadata have the hash (`metadata_hash`) of those of the server that answered first. `accepted`: the hashes that
    may answer instead, the first server's too; "" is a server that says nothing of itself.
    """

    def __init__(self, *servers: _Server, accepted: Collection[str] = ()) -> None:
        if not servers:
            raise Refused("FailOver: name the servers", _library.USAGE)
        if isinstance(accepted, str) or not all(isinstance(one, str) for one in accepted):
            raise Refused("FailOver: accepted is a list of metadata hashes, such as accepted=['0123456789abcdef']", _library.USAGE)
        self.servers = servers
        self._accepted = frozenset(accepted)
        self._hash_asked = ""  # of the server asked last
        for server in servers:
            server.refusal = self._refusal
        self._asked = self._answered = 0  # places
        self.problem: str = ""  # why the last infer() had no answer; empty: it had one

    def __enter__(self) -> "FailOver":
        return self

    def __exit__(self, kind: Optional[Type[BaseException]], error: Optional[BaseException], trace: Optional[TracebackType]) -> None:
        self.close()

    def infer(self, observation: Mapping[str, Any], **more: Any) -> Optional[NDArray[np.float32]]:
        """As the servers' own, `more` of its arguments included; what is sent is the same to each."""
        began = time.monotonic()
        problems: List[str] = []
        for _ in self.servers:
            server = self.servers[self._asked]
            actions = server.infer(observation, **more)
            if actions is not None:
                self.problem = ""
                self._note_answer(server)
                return actions
            problems.append(server.problem)
            self.problem = "; ".join(problems)
            self._asked = (self._asked + 1) % len(self.servers)
            if time.monotonic() - began > server.deadline_s / 2:
                break
        return None

    def _refusal(self, said: str) -> str:
        """Asked by a server of ours before it is sent a question; its metadata have the hash `said`."""
        self._hash_asked = said
        if said in self._accepted or not self._accepted:
            return ""
        wanted = " or ".join(one or "none" for one in sorted(self._accepted))
        return f"is not asked: it has metadata {said or 'none'}, not {wanted}; see FailOver(accepted=...)"

    @property
    def source(self) -> str:
        """Of the server that answered last."""
        return self.servers[self._answered].source

    def _note_answer(self, server: _Server) -> None:
        self._accepted = self._accepted or frozenset({self._hash_asked})
        if self._asked != self._answered:
            _log.warning("%s answers in the place of %s", server.url, self.servers[self._answered].url)
            self._answered = self._asked

    def close(self) -> None:
        """Ends all connections. A second time does nothing."""
        for server in self.servers:
            server.close()
