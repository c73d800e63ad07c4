#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: every unit is one that systemd understands, exposes no more than is promised, and names commands and options
that exist. Method: systemd's own judges (`systemd-analyze verify` and `security --offline`, which need no running
systemd) on copies whose programs are this build's, one with the drop-in of docs/own-engine.md; then every ExecStart's
and ExecStopPost's options are looked up in that program's --help. Usage: units_test.py SYSTEMD_DIR BIN_DIR. Exit codes: 0 fine, 1 not, 77 systemd is not installed.
"""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

MOST_EXPOSED = {"takt-executive.service": 2.5, "takt-policy-host@.service": 2.0, "takt-monitor.service": 2.0}
MOST_EXPOSED_OTHERWISE = 2.0
# What the issue of exposure does not see, and must never get lost.
DEMANDED = {
    "takt-executive.service": ["Type=notify", "WatchdogSec=", "CPUSchedulingPolicy=fifo", "CPUAffinity=", "LimitMEMLOCK=",
                               "LimitRTPRIO=", "AmbientCapabilities=", "OOMScoreAdjust=", "User=takt",
                               "ExecStopPost="],
    "takt-policy-host@.service": ["User=takt-policy\n", "PrivateNetwork=yes", "RestrictAddressFamilies=AF_UNIX",
                                  "DevicePolicy=closed", "MemoryMax=", "CPUQuota=", "ProtectSystem=strict"],
    "takt-policy-host-fallback@.service": ["User=takt-policy-fallback\n", "PrivateNetwork=yes", "RestrictAddressFamilies=AF_UNIX",
                                           "DevicePolicy=closed", "MemoryMax=", "CPUQuota=", "ProtectSystem=strict",
                                           "ExecStart=/usr/bin/takt-policy-host --fenced --fallback ", "SuccessExitStatus=65"],
    "takt-policy-bridge.service": ["User=takt-policy-bridge\n"],
    # A restart of takt.target, as `takt deploy` does it, applies a new file's bit rates and control core.
    "takt-can@.service": ["After=sys-subsystem-net-devices-%i.device takt-irq-affinity.service\n", "PartOf=takt.target\n",
                          "Before=takt-executive.service\n"],
    "takt-irq-affinity.service": ["PartOf=takt.target\n", "Before=takt-executive.service\n"],
}


def output_of(*command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=120)
    return done.returncode, done.stdout


def copy_units(source, folder, bin_dir):
    """The units as they are, but with this build's programs, so that `verify` finds what they start."""
    for unit in source.iterdir():
        if unit.suffix in (".service", ".target"):
            text = unit.read_text().replace("/usr/bin/takt", f"{bin_dir}/takt")
            (folder / unit.name).write_text(text.replace("/usr/lib/takt/irq-affinity", str(source / "irq-affinity")))


def add_documented_drop_in(page, folder):
    """`verify` reads it with the unit that it changes."""
    text = re.search(r"```ini\n(.*?)```", page.read_text(), re.S)[1]
    drop_in = folder / "takt-policy-host@robot.service.d"
    drop_in.mkdir()
    (drop_in / "override.conf").write_text(text)


def instance(name):
    return name.replace("@.", "@can0.") if "can" in name else name.replace("@.", "@robot.")


def verify(folder):
    names = sorted(path.name for path in folder.iterdir() if path.is_file())
    for template in [name for name in names if "@." in name]:
        (folder / instance(template)).symlink_to(template)
    code, said = output_of("systemd-analyze", "verify", "--man=no", *(str(folder / instance(name)) for name in names))
    # `verify` only warns about keys it does not know: whatever it says about our files is a problem.
    lines = [line for line in said.splitlines() if "takt" in line]
    return lines + ([f"systemd-analyze verify ended with {code}:\n{said}"] if code != 0 and not lines else [])


def exposure(unit):
    code, said = output_of("systemd-analyze", "security", "--offline=true", "--no-pager", str(unit))
    found = re.search(r"Overall exposure level for \S+: ([\d.]+)", said)
    if not found:
        return [f"{unit.name}: systemd-analyze security said no level ({code}):\n{said}"]
    most = MOST_EXPOSED.get(unit.name, MOST_EXPOSED_OTHERWISE)
    return [] if float(found[1]) <= most else [f"{unit.name}: exposure {found[1]}, at most {most} is promised"]


def unknown_options(unit, bin_dir):
    problems = []
    for command in re.findall(r"^Exec\w+=.*?/usr/bin/(takt[^;\n]*)", unit.read_text(), re.M):
        words = command.split()
        subcommand = [word for word in words[1:3] if re.fullmatch(r"[a-z]+", word)] if words[0] == "takt" else []
        _, said = output_of(str(bin_dir / words[0]), *subcommand, "--help")
        problems += [f"{unit.name}: {words[0]} {' '.join(subcommand)} has no {word}"
                     for word in words if word.startswith("--") and not re.search(rf"(?<!\S){word}\b", said)]
    return problems


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 64
    source, bin_dir = (pathlib.Path(word).resolve() for word in sys.argv[1:])
    if not shutil.which("systemd-analyze"):
        print("SKIPPED: systemd is not installed: NO UNIT WAS TESTED")
        return 77
    units = sorted(source.glob("*.service"))
    problems = []
    with tempfile.TemporaryDirectory(prefix="takt-units.") as folder:
        copy_units(source, pathlib.Path(folder), bin_dir)
        add_documented_drop_in(source.parent / "docs/own-engine.md", pathlib.Path(folder))
        problems += verify(pathlib.Path(folder))
    for unit in units:
        problems += exposure(unit) + unknown_options(unit, bin_dir)
        problems += [f"{unit.name}: lost {line.strip()}" for line in DEMANDED.get(unit.name, []) if "\n" + line not in unit.read_text()]
    print("\n".join(problems) or f"{len(units)} units are clean")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
