# SPDX-License-Identifier: Apache-2.0
"""What is installed in the guest: takt's package, from a folder that `./dev package` filled."""
from __future__ import annotations

import hashlib
import pathlib
import re
import shutil
import subprocess


class BadPackage(Exception):
    """Nothing that can be installed: one sentence."""


def package_in(folder: pathlib.Path) -> pathlib.Path:
    """Not takt-dev, which `./dev package` puts beside it: no robot PC needs that."""
    packages = sorted(folder.glob("takt_*.deb"))
    if len(packages) != 1:
        raise BadPackage(f"{folder}: {len(packages)} files takt_*.deb in it, where one is needed: ./dev package makes it")
    return packages[0]


def required_packages(package: pathlib.Path) -> list[str]:
    """The names that it depends on; of alternatives the first."""
    command = ["dpkg-deb", "-f", str(package), "Depends"]
    fields = subprocess.run(command, check=True, capture_output=True, text=True).stdout.split(",")
    return sorted({match[0] for field in fields if (match := re.match(r"[a-z0-9][a-z0-9.+-]+", field.strip()))})


def hand_over(package: pathlib.Path, job: pathlib.Path) -> None:
    """Puts it where the guest looks for it."""
    shutil.copy(package, job / "takt.deb")


def hash_of(package: pathlib.Path) -> str:
    return hashlib.sha256(package.read_bytes()).hexdigest()


def programs_of(package: pathlib.Path, folder: pathlib.Path) -> pathlib.Path:
    """Its programs, to use on this machine."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    subprocess.run(["dpkg-deb", "-x", str(package), str(folder)], check=True)
    return folder / "usr/bin"
