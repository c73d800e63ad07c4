# SPDX-License-Identifier: Apache-2.0
"""What is said when something is refused."""
import sys
from types import TracebackType
from typing import Optional, Type


class Refused(Exception):
    """One sentence: what is wrong, where, how to correct it. Uncaught, it ends the program with that line alone and `exit_code`:
    65 the robot file, or what the policy says it is; 69 the executive answered, and refused; 64 a call that cannot be meant;
    70 a fault of the library.
    """

    def __init__(self, sentence: str, exit_code: int = 65) -> None:
        super().__init__(sentence)
        self.exit_code = exit_code


_before = sys.excepthook


def _hook(kind: Type[BaseException], error: BaseException, trace: Optional[TracebackType]) -> None:
    if not isinstance(error, Refused):
        _before(kind, error, trace)
        return
    print(error, file=sys.stderr, flush=True)
    raise SystemExit(error.exit_code)


sys.excepthook = _hook
