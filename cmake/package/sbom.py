#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The list of what is in the programs, as SPDX 2.3 JSON: sbom.py VERSION DATE OUT BIN_DIR

Shared libraries are those that the programs in BIN_DIR name, each with the Debian package that it comes from on this machine;
what is compiled in from other packages' headers and scripts is in BUILT_IN. The same machine gives the same list.
Exit codes: 0 written; 1 a package is not installed; 64 command line.
"""
import json
import pathlib
import re
import subprocess
import sys

BUILT_IN = {"nlohmann-json3-dev": "MIT", "libcli11-dev": "BSD-3-Clause", "libeigen3-dev": "MPL-2.0", "libjs-dygraphs": "MIT",
            "libboost-dev": "BSL-1.0"}
PROGRAMS = ("takt", "takt-operate", "takt-lab", "takt-executive", "takt-policy-host", "takt-plant", "takt-monitor", "takt-imu", "takt-ros-sensors", "takt-policy-bridge",
            "takt-policy-server")


def said(*words):
    return subprocess.run(words, check=True, capture_output=True, text=True, env={"LC_ALL": "C", "PATH": "/usr/sbin:/usr/bin:/sbin:/bin"}).stdout


def packages_of(bin_dir):
    """Debian packages of the shared libraries that the programs themselves name."""
    needed, places = set(), {}
    for path in (bin_dir / program for program in PROGRAMS):
        if path.name == "takt-lab" and not path.exists():
            continue  # built without it
        needed |= set(re.findall(r"NEEDED +(\S+)", said("objdump", "-p", path)))
        places.update(re.findall(r"(\S+) => (/\S+)", said("ldd", path)))
    ways = {}  # how a package may name it: by the link or what it points to, below /usr or not
    for library in sorted(needed & set(places)):
        path = pathlib.Path(places[library])
        if not path.is_relative_to(bin_dir.parent):  # else it is ours
            ways[path] = {str(name).removeprefix(usr) for name in (path, path.resolve()) for usr in ("/usr", "")}
    wanted = sorted(set().union(*ways.values()))
    owners = subprocess.run(["dpkg-query", "-S", *wanted], capture_output=True, text=True).stdout  # exit code 1: not by every name
    owner_of = {path: owner.partition(":")[0] for owner, path in (line.split(": ", 1) for line in owners.splitlines() if ": " in line)}
    found = set()
    for path, names in ways.items():
        owner = next((owner_of[name] for name in sorted(names) if name in owner_of), None)
        if owner is None:
            sys.exit(f"sbom.py: no package has {path}")
        found.add(owner)
    return found


def package(name, version, license_id):
    return {"SPDXID": "SPDXRef-" + re.sub(r"[^A-Za-z0-9.]", "-", name), "name": name, "versionInfo": version, "downloadLocation": "NOASSERTION",
            "filesAnalyzed": False, "licenseConcluded": license_id, "licenseDeclared": license_id, "copyrightText": "NOASSERTION"}


def main():
    if len(sys.argv) != 5:
        print(__doc__, file=sys.stderr)
        return 64
    version, date, out, bin_dir = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3]), pathlib.Path(sys.argv[4]).resolve()
    linked = packages_of(bin_dir)
    own = package("takt", version, "Apache-2.0")
    others = [(name, license_id, "CONTAINS") for name, license_id in BUILT_IN.items()] + [(name, "NOASSERTION", "DYNAMIC_LINK") for name in sorted(linked)]
    packages, relations = [own], [{"spdxElementId": "SPDXRef-DOCUMENT", "relationshipType": "DESCRIBES", "relatedSpdxElement": own["SPDXID"]}]
    for name, license_id, how in others:
        one = package(name, said("dpkg-query", "-W", "-f", "${Version}", name), license_id)
        packages.append(one)
        relations.append({"spdxElementId": own["SPDXID"], "relationshipType": how, "relatedSpdxElement": one["SPDXID"]})
    source = said(bin_dir / "takt", "--version").split()[-1]
    document = {"spdxVersion": "SPDX-2.3", "dataLicense": "CC0-1.0", "SPDXID": "SPDXRef-DOCUMENT", "name": f"takt-{source}",
                "documentNamespace": f"https://example.org/spdx/takt-{source}",
                "creationInfo": {"created": said("date", "-u", "-d", date, "+%Y-%m-%dT%H:%M:%SZ").strip(), "creators": ["Tool: takt-sbom.py"]},
                "packages": packages, "relationships": relations}
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(document, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
