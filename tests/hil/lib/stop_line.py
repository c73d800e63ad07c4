#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""stop_line.py SOCKET: takes every drive's power away by one datagram into the executive's stop line, and prints when, in
seconds of CLOCK_REALTIME, read before it is sent. What the message holds: executive/contract/session.hpp."""
import socket
import struct
import sys
import time

DEENERGISE = 6
message = struct.pack("<8sB7xQ", b"\r\nTAKT01", DEENERGISE, 0)
with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as line:
    line.connect(sys.argv[1])
    asked_at = time.clock_gettime_ns(time.CLOCK_REALTIME)
    line.send(message)
print(f"{asked_at // 10**9}.{asked_at % 10**9:09d}")
