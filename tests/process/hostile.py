# SPDX-License-Identifier: Apache-2.0
"""What is common to servers that behave well until a test says otherwise."""
import collections
import time
from typing import Callable, NamedTuple

from wire import Wire


def nothing(_server):
    pass


class Behaviour(NamedTuple):
    """`answers(server, ...)`: in the place of the good answer, if it is given. `before`, `begins`, `ends`: called with the server: before the robot
    arms, at the moment from which it is hostile, and when it is good again. Not `stops`: the robot goes on.
    """

    answers: Callable = None
    begins: Callable = nothing
    ends: Callable = nothing
    before: Callable = nothing
    stops: bool = True


class Hostile:
    """`server` behind a wire. `answered`: numbers of the questions that were answered well; `acts`: of the present behaviour, by connection."""

    def __init__(self, server):
        self.server, self.wire = server, Wire(server)
        self.url = self.wire.url
        self.answered, self.acts = set(), collections.Counter()
        self.behaviour, self.will_stall = None, False

    def begin(self, behaviour):
        self.acts.clear()
        self.behaviour = behaviour
        behaviour.begins(self)

    def end(self):
        behaviour, self.behaviour = self.behaviour, None
        behaviour.ends(self)

    def way(self, well):
        """How the present question is answered."""
        return self.behaviour.answers if self.behaviour is not None and self.behaviour.answers else well

    def stall_once(self):
        """The whole server: what is asked meanwhile is read and answered afterwards."""
        if self.will_stall:
            self.will_stall = False
            time.sleep(5)

    def close(self):
        self.wire.close()


def will_stall(server):
    server.will_stall = True


CUT = Behaviour(begins=lambda server: server.wire.whole.clear(), ends=lambda server: server.wire.whole.set())
DRIBBLE = Behaviour(begins=lambda server: server.wire.dribbles.set(), ends=lambda server: server.wire.dribbles.clear())
