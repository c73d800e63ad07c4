#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: every DBC file in drivers/dbc says the same as our codecs and as the published vectors.

Method: a foreign reader, Debian's python3-canmatrix, decodes through the file (a) what our encoders produce, printed by
the helper program, and (b) frames written out by hand below. Every message of every file must be met at least once.

  dbc_check.py FOLDER_OF_DBC_FILES HELPER

To add a file: put it into the folder, its vectors into VECTORS, its encoders into dbc_vectors.cpp.
"""

import math
import pathlib
import subprocess
import sys

try:
    import canmatrix
    import canmatrix.formats
except ImportError:
    print("SKIPPED: no module canmatrix: apt-get install python3-canmatrix", file=sys.stderr)
    sys.exit(77)

# file: [(id, data, {signal: value})]. 1.5 is 3fc00000, -0.25 is be800000, -0.75 is bf400000.
VECTORS = {
    # -125 per mille is 0xFF83; positions and words little-endian.
    "cia402_cst.dbc": [
        (0x205, "0f000a83ff", {"Controlword": 15, "Mode_of_operation": 10, "Target_torque": -125}),
        (0x185, "3712feffffff83ff", {"Statusword": 0x1237, "Position_actual": -2, "Torque_actual": -125}),
        (0x085, "1023030000000000", {"Error_code": 0x2310, "Error_register": 3}),
        (0x705, "05", {"NMT_state": 5}),
    ],
    # By hand, from the makers' pages: code c of n bits over +-r is (2 c / (2^n - 1) - 1) r, over 0..r it is r c / (2^n - 1).
    "DM4310.dbc": [
        (0x001, "c000400800200c00", {"Position": 12.5 * (2 * 0xC000 / 65535 - 1), "Velocity": 30 * (2 * 0x400 / 4095 - 1),
                                     "Kp": 500 * 0x800 / 4095, "Kd": 5 * 0x200 / 4095, "Torque": 10 * (2 * 0xC00 / 4095 - 1)}),
        (0x011, "b14000c004002d1e", {"State": 11, "Drive": 1, "Position": 12.5 * (2 * 0x4000 / 65535 - 1), "Velocity": 30 * (2 * 0xC00 / 4095 - 1),
                                     "Torque": 10 * (2 * 0x400 / 4095 - 1), "Temperature_MOS": 45, "Temperature_Rotor": 30}),
    ],
    "AK10-9.dbc": [
        (0x000, "014000c004004105", {"Drive": 1, "Position": 12.5 * (2 * 0x4000 / 65535 - 1), "Velocity": 50 * (2 * 0xC00 / 4095 - 1),
                                     "Torque": 65 * (2 * 0x400 / 4095 - 1), "Temperature": 25, "Error": 5}),
    ],
    "RS03.dbc": [
        (0x028001FD, "c0004000800000ff", {"Position": 4 * math.pi * (2 * 0xC000 / 65535 - 1), "Velocity": 20 * (2 * 0x4000 / 65535 - 1),
                                          "Torque": 60 * (2 * 0x8000 / 65535 - 1), "Temperature": 25.5}),
    ],
    "odrive.dbc": [
        (0x06C, "0000c03f06ffb004", {"Input_Position": 1.5, "Velocity_FF": -0.25, "Torque_FF": 1.2}),
        (0x06E, "000040bf", {"Torque_Setpoint": -0.75}),
        (0x067, "08000000", {"Requested_State": 8}),
        (0x061, "0020000108030100",
         {"Axis_Error": 0x01002000, "Axis_State": 8, "Procedure_Result": 3, "Trajectory_Done": 1}),
        (0x061, "00000000010000fe", {"Axis_Error": 0, "Axis_State": 1, "Trajectory_Done": 0}),
        (0x063, "0000000100000002", {"Active_Errors": 0x01000000, "Disarm_Reason": 0x02000000}),
        (0x069, "0000c03f000080be", {"Position": 1.5, "Velocity": -0.25}),
        (0x074, "0000c03f000080be", {"Iq_Setpoint": 1.5, "Iq_Measured": -0.25}),
        (0x075, "0000c03f000080be", {"FET_Temperature": 1.5, "Motor_Temperature": -0.25}),
        (0x077, "0000c03f000080be", {"Bus_Volts": 1.5, "Bus_Amperes": -0.25}),
        (0x07C, "0000c03f000080be", {"Torque_Target": 1.5, "Torque_Estimate": -0.25}),
    ],
}


def printed_by(helper):
    """What our encoders say, in the shape of VECTORS."""
    vectors = {}
    for line in subprocess.run([helper], capture_output=True, text=True, check=True).stdout.splitlines():
        file, identifier, data, *signals = line.split()
        wanted = {name: float(value) for name, value in (signal.split("=") for signal in signals)}
        vectors.setdefault(file, []).append((int(identifier, 16), "" if data == "-" else data, wanted))
    return vectors


def complaints_about(message, data, wanted):
    raw = bytes.fromhex(data)
    if message.size != len(raw):
        yield f"is {message.size} bytes long, the frame {len(raw)}"
        return
    decoded = message.decode(raw) if raw else {}
    for name, value in wanted.items():
        if name not in decoded:
            yield f"has no signal {name}"
        elif not math.isclose(float(decoded[name].phys_value), value, rel_tol=1e-6, abs_tol=1e-9):
            yield f"{name} reads {decoded[name].phys_value}, expected {value}"


def check(file, vectors):
    """Prints what is wrong with one file; returns how much."""
    problems = 0
    messages = {message.arbitration_id.id: message for message in canmatrix.formats.loadp_flat(str(file)).frames}
    met = set()
    for identifier, data, wanted in vectors:
        met.add(identifier)
        found = ["is missing"] if identifier not in messages else complaints_about(messages[identifier], data, wanted)
        for complaint in found:
            problems += 1
            print(f"{file.name}: message {identifier:#x} ({data}) {complaint}")
    for identifier in sorted(set(messages) - met):
        problems += 1
        print(f"{file.name}: message {identifier:#x} {messages[identifier].name} has no vector")
    print(f"{file.name}: {len(messages)} messages, {len(vectors)} vectors, {problems} problems")
    return problems


def main():
    folder, helper = pathlib.Path(sys.argv[1]), sys.argv[2]
    encoded = printed_by(helper)
    files = sorted(folder.glob("*.dbc"))
    problems = 0 if files else 1
    for name in (set(VECTORS) | set(encoded)) - {file.name for file in files}:
        problems += 1
        print(f"{name}: vectors without a file")
    for file in files:
        problems += check(file, VECTORS.get(file.name, []) + encoded.get(file.name, []))
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
