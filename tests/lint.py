#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""clang-tidy on every source of the product, as the given build folder compiles it.

What was clean stays clean: a source is checked again only when it, one of the project's headers that it reads, the
settings or clang-tidy itself have changed. That is remembered per user, so that a fresh clone starts warm.
On a machine that remembers nothing all of them take an hour of its processors. --for SECONDS begins with what changed
last and leaves what it did not come to for the next time; it says how many.
Usage: lint.py BUILD_FOLDER [--for SECONDS], from the project's top folder; BUILD_FOLDER is configured, and its
generated headers are made. Exit code 1 when something was found.
"""
import concurrent.futures
import functools
import hashlib
import os
import pathlib
import re
import subprocess
import sys
import time

ROOMS = ("executive", "drivers", "commissioning", "dds", "policy_host", "client", "monitor", "config", "sensors", "simulation", "evidence", "lab", "systemd", "cli")
# libtorch 1.13's headers, which clang refuses from C++20 on: a vector of a type that is not complete yet.
LEFT_OUT = {"policy_host/torchscript/torchscript_engine.cpp", "policy_host/torchscript/row_products.cpp"}
CLANG_TIDY = "clang-tidy-19"
OPTIONS = ["--quiet", "--extra-arg=-Wno-unknown-warning-option", "--extra-arg=-Wno-deprecated-declarations"]
FORGET_AFTER_S = 60 * 24 * 3600


def output_of(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@functools.cache
def included_by(path):
    """The project's files that this one names."""
    named = re.findall(r'^\s*#\s*include\s*"([^"]+)"', pathlib.Path(path).read_text(), re.M)
    beside = (os.path.normpath(os.path.join(folder, name)) for name in named for folder in ("", os.path.dirname(path)))
    return frozenset(name for name in beside if os.path.isfile(name))


def headers_of(source):
    """All that it reads of this project."""
    found, new = set(), set(included_by(source))
    while new:
        found |= new
        new = set().union(*map(included_by, new)) - found
    return found


@functools.cache
def digest(path):
    return hashlib.sha256(pathlib.Path(path).read_bytes()).hexdigest()


def stamp_of(source, headers, settings):
    parts = [settings, source, digest(source)] + [f"{header}={digest(header)}" for header in sorted(headers)]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def newest_first(sources):
    """By the commit that changed each last; what no commit has comes first of all."""
    order = {}
    for line in output_of("git", "log", "--format=", "--name-only", "--no-renames", "-n", "400").splitlines():
        order.setdefault(line, len(order))
    changed = set(output_of("git", "diff", "--name-only", "HEAD").splitlines())
    return sorted(sources, key=lambda source: (source not in changed, order.get(source, len(order))))


def check(build, source, stamp, until):
    """True: clean; False: something was found; None: there was no time left to look."""
    if stamp.exists():
        stamp.touch()
        return True
    if time.monotonic() > until:
        return None
    found = subprocess.run([CLANG_TIDY, *OPTIONS, "-p", build, source], stdout=subprocess.PIPE,
                           stderr=subprocess.DEVNULL, text=True)
    if found.returncode == 0:
        stamp.touch()
        return True
    print(f"{found.stdout}lint: {source} (above)", flush=True)
    return False


def main():
    build = os.path.abspath(sys.argv[1])
    until = time.monotonic() + float(sys.argv[3]) if sys.argv[2:3] == ["--for"] else float("inf")
    cache = pathlib.Path(os.environ.get("XDG_CACHE_HOME", pathlib.Path.home() / ".cache"), "takt", "lint")
    cache.mkdir(parents=True, exist_ok=True)
    for old in cache.iterdir():
        if old.stat().st_mtime < time.time() - FORGET_AFTER_S:
            old.unlink()
    settings = digest(".clang-tidy") + digest(__file__) + output_of(CLANG_TIDY, "--version")
    listed = output_of("git", "ls-files", *(f"{room}/*.cpp" for room in ROOMS)).split()
    sources = [source for source in listed if source not in LEFT_OUT]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        clean = list(pool.map(
            lambda source: check(build, source, cache / stamp_of(source, headers_of(source), settings), until),
            newest_first(sources)))
    left = f", {clean.count(None)} are left for the next time" if None in clean else ""
    print(f"{clean.count(True)} of {len(clean)} sources are clean{left}")
    sys.exit(1 if False in clean else 0)


if __name__ == "__main__":
    main()
