#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""An Xsens MTi on interface INTERFACE, level and at rest, with a little noise: four frames 200 times a second, until a signal ends it."""
import itertools
import random
import socket
import struct
import sys
import time

bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
bus.bind((sys.argv[1],))
begin = time.monotonic()
for count in itertools.count():
    noise = random.randint(0, 3)
    for number, data in ((0x106, struct.pack(">H", count & 0xFFFF)), (0x121, struct.pack(">4h", 32767, 0, 0, 0)),
                         (0x132, struct.pack(">3h", noise, 0, 0)), (0x134, struct.pack(">3h", 0, 0, 2511))):
        bus.send(struct.pack("=IB3x8s", number, len(data), data))
    time.sleep(max(0.0, begin + 0.005 * (count + 1) - time.monotonic()))
