# SPDX-License-Identifier: Apache-2.0
"""Quantities as robot files write them."""
from takt import _library
from takt._refused import Refused


def seconds(text: str, what: str) -> float:
    """Of "80 ms". `what` names it in the refusal."""
    number, _, unit = text.strip().partition(" ")
    try:
        return float(number) * {"us": 1e-6, "ms": 1e-3, "s": 1.0}[unit]
    except (KeyError, ValueError):
        raise Refused(f"{what} {text!r} is no time; write one such as '80 ms'", _library.USAGE) from None
