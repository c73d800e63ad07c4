#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: half an upgrade leaves a robot that can be stopped: `takt stop`, `status`, `arm` and `reset` need no library but
the compiler's and libc. Method: the libraries that any program of Takt is linked to are hidden one after the other, by
a mount in a namespace of its own, and each verb is asked of a real executive; the answer has to be the executive's.

Arguments: source folder, folder of programs. Exit codes: 0 fine, 1 not, 77 no mount namespace may be made here (1 with
TAKT_REQUIRE_NAMESPACES=1)."""
import json
import os
import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import time

source, programs = (pathlib.Path(argument).resolve() for argument in sys.argv[1:3])
OWN = re.compile(r"(libc|libm|libstdc\+\+|libgcc_s|ld-linux[^.]*)\.so")
VERBS = ("status", "arm", "stop", "reset")


def libraries(program):
    said = subprocess.run(["ldd", program], capture_output=True, text=True).stdout
    return set(re.findall(r"=> (/\S+)", said)) | set(re.findall(r"^\s(/\S+)", said, re.M))


def namespace():
    """The words that run a command in a mount namespace; none: not permitted here."""
    for words in (["unshare", "--mount"], ["unshare", "--map-root-user", "--mount"]):
        if subprocess.run([*words, "sh", "-c", "mount --bind /dev/null /etc/hostname"], capture_output=True).returncode == 0:
            return words
    return None


def ask(verb, runtime, before=()):
    return subprocess.run([*before, programs / "takt", verb, "--runtime-dir", runtime, "--json"], capture_output=True,
                          text=True, timeout=60)


def is_answered(ended):
    try:
        return ended.returncode in (0, 1) and json.loads(ended.stdout)["status"]["mode"] != ""
    except (json.JSONDecodeError, KeyError, TypeError):
        return False


def silent_buses(runtime):
    """Buses at which no drive answers: sockets that only accept."""
    listeners = []
    for bus in ("hidden0", "hidden1"):
        listeners.append(socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET))
        listeners[-1].bind(str(runtime / f"can-{bus}.sock"))
        listeners[-1].listen()
    return listeners


def robot(folder):
    """The demo arm on those buses: it stands in standby, and no policy plays."""
    text = (source / "config/arm6.yaml").read_text()
    for old, new in (("cpu: 1 ", "cpu: none "), ("file: arm6_reach.onnx", f"file: {source}/config/arm6_reach.onnx")):
        assert old in text, old
        text = text.replace(old, new)
    text = re.sub(r"interface: can(\d)", r"interface: hidden\1", text)
    (folder / "arm6.yaml").write_text(text)
    return folder / "arm6.yaml"


def main():
    direct = {path for path in libraries(programs / "takt") if not OWN.match(pathlib.Path(path).name)}
    assert not direct, f"takt links {', '.join(sorted(direct))}"
    words = namespace()
    if words is None:
        print("NOT TESTED: NO MOUNT NAMESPACE MAY BE MADE HERE: `takt stop` WITH LIBRARIES HIDDEN")
        return 1 if os.environ.get("TAKT_REQUIRE_NAMESPACES") == "1" else 77
    everyone = set().union(*(libraries(program) for program in programs.glob("takt-*") if program.is_file()))
    hidden = sorted({os.path.realpath(path) for path in everyone if not OWN.match(pathlib.Path(path).name)})
    assert len(hidden) > 5, hidden
    failures = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        runtime = folder / "runtime"
        runtime.mkdir()
        buses = silent_buses(runtime)
        with open(folder / "log", "wb") as log:
            executive = subprocess.Popen([programs / "takt-executive", "--robot", robot(folder), "--runtime-dir", runtime,
                                          "--allow-non-realtime"], stdout=log, stderr=log)
        try:
            deadline = time.monotonic() + 60
            while not is_answered(ask("status", runtime)):
                assert executive.poll() is None and time.monotonic() < deadline, (folder / "log").read_text()
                time.sleep(0.05)
            for library in hidden:
                script = f'mount --bind /dev/null "{library}" && exec "$@"'
                for verb in VERBS:
                    ended = ask(verb, runtime, [*words, "sh", "-c", script, "hide"])
                    if not is_answered(ended):
                        failures.append(f"takt {verb} without {library}: {ended.returncode}: {ended.stderr.strip()[-200:]}")
        finally:
            executive.terminate()
            executive.wait(timeout=30)
            for bus in buses:
                bus.close()
    print("\n".join(failures) or f"{len(hidden)} libraries hidden in turn, {len(VERBS)} verbs each: all answered")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
