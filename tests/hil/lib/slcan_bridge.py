#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The far end of a serial CAN adapter: a pty that the kernel takes for one, joined to a virtual CAN interface.

Usage: slcan_bridge.py VCAN     prints the name of the new interface, then passes frames both ways until it is ended.
SIGUSR1: the adapter reports bus-off, and passes nothing until it is opened again (interface down and up).
Only classic frames with standard ids. Source: Documentation of the Lawicel protocol in linux/drivers/net/can/slcan.
"""
import fcntl
import os
import pty
import select
import signal
import socket
import struct
import sys
import termios
import tty

N_SLCAN = 17
SIOCGIFNAME = 0x8910
FRAME = struct.Struct("=IB3x8s")
BUS_OFF = b"sb000255\r"  # state bus-off, receive errors 000, transmit errors 255


def open_adapter() -> tuple[int, str]:
    master, slave = pty.openpty()
    tty.setraw(slave)
    tty.setraw(master)
    fcntl.ioctl(slave, termios.TIOCSETD, struct.pack("i", N_SLCAN))
    name = fcntl.ioctl(slave, SIOCGIFNAME, b"\0" * 40).split(b"\0")[0].decode()
    return master, name


def open_bus(interface: str) -> socket.socket:
    bus = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    bus.bind((interface,))
    return bus


def to_text(frame: bytes) -> bytes:
    can_id, length, data = FRAME.unpack(frame)
    return b"t%03X%d%s\r" % (can_id & 0x7FF, length, data[:length].hex().upper().encode())


def to_frame(text: bytes) -> bytes:
    length = int(text[4:5])
    return FRAME.pack(int(text[1:4], 16), length, bytes.fromhex(text[5:5 + 2 * length].decode()))


class Bridge:
    def __init__(self, interface: str) -> None:
        self.master, self.name = open_adapter()
        self.bus = open_bus(interface)
        self.is_off = False
        self.rest = b""

    def go_bus_off(self, *_: object) -> None:
        self.is_off = True
        os.write(self.master, BUS_OFF)

    def from_kernel(self) -> None:
        *lines, self.rest = (self.rest + os.read(self.master, 4096)).split(b"\r")
        for line in lines:
            if line[:1] == b"O":
                self.is_off = False
            elif line[:1] == b"t" and not self.is_off:
                self.bus.send(to_frame(line))

    def from_bus(self) -> None:
        frame = self.bus.recv(FRAME.size)
        if not self.is_off:
            os.write(self.master, to_text(frame))

    def run(self) -> None:
        while True:
            readable, _, _ = select.select([self.master, self.bus], [], [])
            if self.master in readable:  # always, or the kernel's side fills up
                self.from_kernel()
            if self.bus in readable:
                self.from_bus()


def main() -> None:
    bridge = Bridge(sys.argv[1])
    signal.signal(signal.SIGUSR1, bridge.go_bus_off)
    print(bridge.name, flush=True)
    bridge.run()


main()
