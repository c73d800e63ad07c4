"""What is installed in the guest: a folder of .deb files, or the tree that `cmake --install` staged."""
from __future__ import annotations

import pathlib
import re
import shutil
import subprocess

TOOLS = ("takt", "takt-executive", "takt-policy-host", "takt-plant", "takt-monitor")


class BadPayload(Exception):
    """Nothing that can be installed: one sentence."""


def output_of(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


def debs(payload: pathlib.Path) -> list[pathlib.Path]:
    """Without takt-dev, which `./dev package` puts beside it: no robot PC needs that."""
    return sorted(payload.glob("takt_*.deb"))


def _declared_dependencies(deb: pathlib.Path) -> set[str]:
    """Names only; of alternatives the first."""
    fields = output_of("dpkg-deb", "-f", str(deb), "Depends").split(",")
    return {match[0] for field in fields if (match := re.match(r"[a-z0-9][a-z0-9.+-]+", field.strip()))}


def _linked_packages(payload: pathlib.Path) -> set[str]:
    """The Debian packages of the shared libraries that the staged programs load on this machine."""
    libraries = set()
    for tool in TOOLS:
        found = re.findall(r"=> (/\S+)", output_of("ldd", str(payload / "usr/bin" / tool)))
        libraries |= {str(pathlib.Path(library).resolve()) for library in found}
    # The database knows a file below /usr/lib or below /lib, wherever its package put it; one spelling always fails.
    spellings = sorted(libraries | {library.removeprefix("/usr") for library in libraries})
    owners = subprocess.run(["dpkg-query", "-S", *spellings], check=False, capture_output=True, text=True).stdout
    return set(re.findall(r"^([a-z0-9.+-]+)(?::\w+)?: /", owners, re.MULTILINE))


def required_packages(payload: pathlib.Path) -> list[str]:
    if packages := debs(payload):
        own = {output_of("dpkg-deb", "-f", str(deb), "Package").strip() for deb in packages}
        return sorted(set().union(*(_declared_dependencies(deb) for deb in packages)) - own)
    if not all((payload / "usr/bin" / tool).exists() for tool in TOOLS):
        raise BadPayload(f"{payload}: neither .deb files nor usr/bin/takt in it: build one with ./dev hil")
    return sorted(_linked_packages(payload))


def hand_over(payload: pathlib.Path, folder: pathlib.Path) -> None:
    """Puts the payload where the guest looks for it."""
    folder.mkdir(parents=True)
    if packages := debs(payload):
        for deb in packages:
            shutil.copy(deb, folder)
        return
    subprocess.run(["tar", "-c", "-f", str(folder / "tree.tar"), "--owner=0", "--group=0", "-C", str(payload), "."], check=True)


def unpacked(payload: pathlib.Path, folder: pathlib.Path) -> pathlib.Path:
    """A tree with usr/bin/takt to use on this machine: the staged one itself, or what the packages hold."""
    folder.mkdir(parents=True, exist_ok=True)
    for deb in debs(payload):
        subprocess.run(["dpkg-deb", "-x", str(deb), str(folder)], check=True)
    return folder if debs(payload) else payload
