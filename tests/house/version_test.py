#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: two builds that differ have different versions, and dpkg knows the newer one. Method: cmake/version.cmake in
repositories made for it: two commits, one with a change, a folder outside of git, one inside another repository.

Arguments: source folder, cmake."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

source, cmake = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2]
clean = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}


def git(folder, *words):
    subprocess.run(["git", "-c", "user.name=t", "-c", "user.email=t@example.org", *words], cwd=folder, check=True,
                   capture_output=True, env=clean)


def version_of(folder):
    out = folder.parent / (folder.name + ".cpp")
    subprocess.run([cmake, f"-DROOT={folder}", "-DRELEASE=0.1.0", f"-DOUT={out}", "-P", source / "cmake/version.cmake"],
                   check=True, env=clean)
    text = out.read_text()
    return (re.search(r'version\(\) \{ return "(.*?)"', text)[1], re.search(r'sha256\(\) \{ return "([0-9a-f]{64})"', text)[1],
            out)


def is_older(one, other):
    return subprocess.run(["dpkg", "--compare-versions", one + "-1", "lt", other + "-1"]).returncode == 0


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name) / "checkout"
    code = folder / "executive/tick.cpp"
    code.parent.mkdir(parents=True)
    code.write_text("int a;\n")
    git(folder, "init", "-q")
    git(folder, "add", ".")
    git(folder, "commit", "-qm", "one")
    first, its_sources, written = version_of(folder)
    assert re.fullmatch(r"0\.1\.0\+git1\.[0-9a-f]{12}", first), first
    at = written.stat().st_mtime_ns
    assert version_of(folder)[0] == first and written.stat().st_mtime_ns == at, "a build without a commit writes nothing"

    code.write_text("int b;\n")
    changed, other_sources, _ = version_of(folder)
    assert changed == first + ".dirty", changed
    assert other_sources != its_sources, "sources that were not committed count"
    git(folder, "commit", "-qam", "two")
    second, _, _ = version_of(folder)
    assert re.fullmatch(r"0\.1\.0\+git2\.[0-9a-f]{12}", second), second
    for commit in range(3, 12):
        (folder / "notes").write_text(str(commit))
        git(folder, "add", ".")
        git(folder, "commit", "-qm", str(commit))
    eleventh = version_of(folder)[0]
    for older, newer in (("0.1.0", first), (first, changed), (changed, second), (second, eleventh), (eleventh, "0.2.0~rc1")):
        assert is_older(older, newer), f"dpkg does not take {newer} for newer than {older}"

    archive = pathlib.Path(name) / "archive"
    shutil.copytree(folder, archive, ignore=shutil.ignore_patterns(".git"))
    unpacked, sources, _ = version_of(archive)
    assert unpacked == f"0.1.0+src.{sources[:12]}", unpacked
    inside = folder / "vendor/takt"
    shutil.copytree(archive, inside)
    assert version_of(inside)[0] == unpacked, "another repository's commit is not its own"
    (inside / "executive/tick.cpp").write_text("int c;\n")
    assert version_of(inside)[0] != unpacked, "other sources, other version"
print("versions tell builds apart, and dpkg orders them")
