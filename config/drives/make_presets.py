#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What is known of drive models, a sheet each (config/drives/MODEL.yaml), into what is made of it: the table of presets
(config/drive_preset_table.hpp), that of docs/drives.md, and drivers/dbc/MODEL.dbc where all ranges are settled. Writes
them; with --check writes nothing and says which is old. Exit codes: 0 fine, 1 old, 64 usage, 65 a sheet is wrong.

A sheet: model, maker, protocol (mit or robstride), variant (mit: tmotor or damiao), aliases (other names of the same
drive, where there are any), and sources, each with `where` it was read, its `kind`, and what it says, side of the drive's
output:
  position_range rad, velocity_range rad/s, torque_range Nm, kp_range Nm/rad, kd_range Nm s/rad; numbers, or "4 pi"
What packed fields span scales every command. So a range has a value only where its sources agree, to half a percent, and
where they are the maker's manual or at least two; the first one's word counts. kind: manual, code (that drives such a
motor), bench (measured), or seller, whose table counts for nothing: it may be copied. Another range stands in the robot
file. A table of the MIT protocol is no source for a RobStride in its own protocol: the same drive spans other ranges there.
"""
import collections
import dataclasses
import math
import pathlib
import sys

import yaml

RANGES = ["position_range", "velocity_range", "torque_range", "kp_range", "kd_range"]
UNITS = dict(zip(RANGES, ["rad", "rad/s", "Nm", "Nm/rad", "Nm s/rad"]))
KINDS = ["manual", "code", "bench", "seller"]
AGREE_WITHIN = 0.005
ORDER = ["AK80-9", "AK10-9", "AK60-6", "AK70-10", "AK80-6", "AK80-64", "DM3507", "DM4310", "DM4310_48V", "DM4310P", "DM4340",
         "DM4340_48V", "DM6006", "DM6248P", "DM8006", "DM8009", "DM10010L", "DM10010", "DM10422P", "DMH3510", "DMH6215",
         "DMG6220", "DMJH11", "CyberGear", "RS00", "RS01", "RS02", "RS03", "RS04", "RS05", "RS06"]
TABLE_HEAD = "| model | velocity, rad/s | torque, Nm | sources; maker's name |\n|---|---|---|---|\n"


class WrongSheet(Exception):
    pass


@dataclasses.dataclass
class Sheet:
    model: str
    maker: str
    protocol: str
    variant: str  # of mit: tmotor or damiao
    aliases: list
    sources: list

    def said(self, name):
        """(number, as written, source) of every source that counts."""
        return [(number(source[name]), source[name], source)
                for source in self.sources if name in source and source["kind"] != "seller"]

    def settled(self, name):
        """The value as written; None: its sources disagree, or there is one that is not the maker's."""
        said = self.said(name)
        if not said or not all(abs(value - said[0][0]) <= AGREE_WITHIN * said[0][0] for value, _, _ in said):
            return None
        known = len(said) >= 2 or said[0][2]["kind"] == "manual"
        return said[0][1] if known else None

    def unsettled(self):
        """"45 or 50 rad/s"; empty: everything is settled."""
        parts = []
        for name in RANGES:
            if self.settled(name) is None:
                values = sorted({f"{one[0]:g}" for one in self.said(name)}, key=float)
                alone = ", one source" if len(values) == 1 else ", no source" if not values else ""
                parts.append(" or ".join(values) + " " + UNITS[name] + alone)
        return "; ".join(parts)

    def names(self):
        """Where what is settled comes from, and who else agrees or is outweighed."""
        also = [f"the maker's name: {', '.join(self.aliases)}"] if self.aliases else []
        return "; ".join([self.name(source) for source in self.sources] + also)

    def kinds(self):
        """Of what kind the sources are, and the maker's name: "manual, 2 code; DM-J4310-2EC"."""
        counts = collections.Counter(source["kind"] for source in self.sources)
        kinds = ", ".join(kind if counts[kind] == 1 else f"{counts[kind]} {kind}" for kind in KINDS if counts[kind])
        return "; ".join([kinds, *self.aliases])

    def name(self, source):
        says = [f"{number(source[name]):g} {UNITS[name]}" for name in ("velocity_range", "torque_range") if name in source]
        whole = all(name in source for name in RANGES)
        return source["where"] if whole else f"{source['where']} says " + ", ".join(says)


def number(written):
    if written == "4 pi":
        return 4 * math.pi
    if isinstance(written, bool) or not isinstance(written, (int, float)) or not 0 < written < math.inf:
        raise WrongSheet(f"`{written}` is no positive number")
    return float(written)


def read(path):
    try:
        data = yaml.safe_load(path.read_text())
        if data["model"] != path.stem:
            raise WrongSheet(f"model is `{data['model']}`, the file's name says otherwise")
        if data["protocol"] not in ("mit", "robstride"):
            raise WrongSheet(f"protocol `{data['protocol']}` packs no ranges")
        if not data["maker"] or (data["protocol"] == "mit") != (data.get("variant") in ("tmotor", "damiao")):
            raise WrongSheet("maker, or variant of an mit drive, is missing")
        aliases = data.get("aliases", [])
        if not isinstance(aliases, list) or not all(isinstance(alias, str) and alias for alias in aliases):
            raise WrongSheet("aliases is a list of names")
        for source in data["sources"]:
            unknown = set(source) - {"where", "kind", *RANGES}
            if unknown or source["kind"] not in KINDS or not source["where"]:
                raise WrongSheet(f"a source needs where, and a kind of {', '.join(KINDS)}; unknown: {sorted(unknown)}")
            for name in RANGES:
                if name in source:
                    number(source[name])
        return Sheet(data["model"], data["maker"], data["protocol"], data.get("variant", ""), aliases, data["sources"])
    except WrongSheet as wrong:
        raise WrongSheet(f"{path}: {wrong}") from None
    except (KeyError, TypeError, yaml.YAMLError) as wrong:
        raise WrongSheet(f"{path}: is no sheet: {wrong!r}") from None


def sheets_of(folder):
    sheets = {path.stem: read(path) for path in folder.glob("*.yaml")}
    if sorted(sheets) != sorted(ORDER):
        raise WrongSheet(f"{folder}: sheets and ORDER differ by {sorted(set(sheets) ^ set(ORDER))}")
    return [sheets[model] for model in ORDER]


def cpp_number(written):
    return "kUnsettled" if written is None else "kFourPi" if written == "4 pi" else f"{written:g}"


def cpp(sheets):
    def rows(protocol):
        for sheet in sheets:
            if sheet.protocol == protocol:
                numbers = ", ".join(cpp_number(sheet.settled(name)) for name in RANGES)
                yield (f'    DrivePreset{{"{sheet.model}", "{sheet.variant}", {numbers}, "{sheet.names()}"'
                       + (f', "{sheet.unsettled()}"' if sheet.unsettled() else "") + "},\n")

    def alias_rows():
        for sheet in sheets:
            for alias in sheet.aliases:
                yield f'    ModelAlias{{"{alias}", "{sheet.model}"}},\n'

    return ("// SPDX-License-Identifier: Apache-2.0\n// Made of config/drives/*.yaml by config/drives/make_presets.py: change those.\n#pragma once\n\n#include <array>\n"
            "#include <numbers>\n\n#include \"config/drive_preset.hpp\"\n\nnamespace takt::config {\n\n// clang-format off\n"
            "inline constexpr double kFourPi = 4 * std::numbers::pi;\ninline constexpr std::array kMitPresets{\n"
            + "".join(rows("mit")) + "};\ninline constexpr std::array kRobstridePresets{\n" + "".join(rows("robstride"))
            + "};\ninline constexpr std::array kModelAliases{\n" + "".join(alias_rows()) + "};\n// clang-format on\n\n}  // namespace takt::config\n")


def page_rows(sheets):
    def cell(sheet, name):
        value = sheet.settled(name)
        return "write it" if value is None else f"{number(value):g}"

    return TABLE_HEAD + "".join(
        f"| {sheet.model} | {cell(sheet, 'velocity_range')} | {cell(sheet, 'torque_range')} | {sheet.kinds()} |\n"
        for sheet in sheets)


def page_with(text, rows):
    before, after = text.split(TABLE_HEAD)
    return before + rows + after[after.index("\n\n") + 1:]


# Where packed fields lie: name, first bit as DBC counts big-endian ones, bits, range, signed about zero, unit.
MIT_COMMAND = [("Position", 7, 16, "position_range", True, "rad"), ("Velocity", 23, 12, "velocity_range", True, "rad/s"),
               ("Kp", 27, 12, "kp_range", False, "Nm/rad"), ("Kd", 47, 12, "kd_range", False, "Nms/rad"),
               ("Torque", 51, 12, "torque_range", True, "Nm")]
MIT_REPLY = [("Position", 15, 16, "position_range", True, "rad"), ("Velocity", 31, 12, "velocity_range", True, "rad/s"),
             ("Torque", 35, 12, "torque_range", True, "Nm")]
ROBSTRIDE_REPLY = [("Position", 7, 16, "position_range", True, "rad"), ("Velocity", 23, 16, "velocity_range", True, "rad/s"),
                   ("Torque", 39, 16, "torque_range", True, "Nm")]
# As they stand in a DBC: first bit, bits (negative: signed), factor, offset, unit. RobStride's reply has its faults and mode in the identifier.
WHOLE_NUMBERS = {"tmotor": {"Drive": (7, 8, 1, 0, ""), "Temperature": (55, 8, 1, -40, "degC"), "Error": (63, 8, 1, 0, "")},
                 "damiao": {"State": (7, 4, 1, 0, ""), "Drive": (3, 4, 1, 0, ""), "Temperature_MOS": (55, 8, 1, 0, "degC"),
                            "Temperature_Rotor": (63, 8, 1, 0, "degC")},
                 "": {"Temperature": (55, -16, 0.1, 0, "degC")}}
EXTENDED = 1 << 31
ROBSTRIDE_RUNNING = 2 << 24 | 2 << 22 | 1 << 8 | 0xFD  # drive 1 tells host FD, in mode 2, without a fault
REPLY_ID = {"tmotor": 0, "damiao": 0x11, "": EXTENDED | ROBSTRIDE_RUNNING}


def dbc_signal(name, first, bits, factor, offset, unit, reader):
    sign = "-" if bits < 0 else "+"
    return f' SG_ {name} : {first}|{abs(bits)}@0{sign} ({factor:.15g},{offset:.15g}) [0|0] "{unit}" {reader}\n'


def dbc_packed(sheet, fields, reader):
    for name, first, bits, key, signed, unit in fields:
        span, codes = number(sheet.settled(key)), 2**bits - 1
        yield dbc_signal(name, first, bits, (2 if signed else 1) * span / codes, -span if signed else 0, unit, reader)


def dbc(sheet):
    """The frames that carry ranges, of drive 1; a number on the bus of one's own is another identifier."""
    text = f'VERSION "{sheet.maker} {sheet.model}, made of config/drives/{sheet.model}.yaml"\n\nNS_ :\n\nBS_:\n\nBU_: Host Drive\n'
    if sheet.protocol == "mit":
        text += "\nBO_ 1 Command: 8 Host\n" + "".join(dbc_packed(sheet, MIT_COMMAND, "Drive"))
    text += f"\nBO_ {REPLY_ID[sheet.variant]} Reply: 8 Drive\n"
    text += "".join(dbc_packed(sheet, MIT_REPLY if sheet.protocol == "mit" else ROBSTRIDE_REPLY, "Host"))
    return text + "".join(dbc_signal(name, *where, "Host") for name, where in WHOLE_NUMBERS[sheet.variant].items())


def main(arguments):
    if arguments not in ([], ["--check"]):
        print(__doc__, file=sys.stderr)
        return 64
    root = pathlib.Path(__file__).resolve().parents[2]
    try:
        sheets = sheets_of(root / "config/drives")
    except WrongSheet as wrong:
        print(wrong, file=sys.stderr)
        return 65
    page = root / "docs/drives.md"
    made = {root / "config/drive_preset_table.hpp": cpp(sheets), page: page_with(page.read_text(), page_rows(sheets))}
    made |= {root / f"drivers/dbc/{sheet.model}.dbc": dbc(sheet) for sheet in sheets if not sheet.unsettled()}
    old = [path for path, text in made.items() if not path.exists() or path.read_text() != text]
    if arguments:
        for path in old:
            print(f"{path.relative_to(root)} is older than the sheets: run config/drives/make_presets.py", file=sys.stderr)
        return 1 if old else 0
    for path in old:
        path.write_text(made[path])
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
