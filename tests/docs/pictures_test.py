#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: the documents' pictures show what today's sources draw. Method: age.svg, top.svg and trace.svg are drawn again and must be
the same bytes; of report.png, which only a browser can draw, the sources' hash must be the one that was written beside it. `./dev
pictures` draws all anew. Usage: pictures_test.py REPOSITORY PROGRAMS [--write]: write the hash. Exit codes: 0 fine, 1 not.
"""
import hashlib
import pathlib
import subprocess
import sys
import tempfile

STALE = "docs/pictures/{} is not what today's sources draw: ./dev pictures"


def hash_of_sources(root):
    sources = sorted((root / "evidence/review/report/page").iterdir()) + [root / "evidence/review/report/report_html.cpp"]
    digest = hashlib.sha256()
    for source in sources:
        digest.update(f"{source.name}\0".encode() + source.read_bytes())
    return digest.hexdigest() + "\n"


def draw(name, programs, root, into):
    if name != "trace":
        subprocess.run([programs / f"make_{name}_picture", into], cwd=root, check=True)
        return
    with tempfile.NamedTemporaryFile(suffix=".json") as trace:
        subprocess.run([programs / "make_perfetto_trace", trace.name], cwd=root, check=True)
        subprocess.run([root / "tests/docs/trace_picture.py", trace.name, into], check=True)


def main():
    root, programs = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    beside = root / "docs/pictures/report.sources.sha256"
    if "--write" in sys.argv:
        beside.write_text(hash_of_sources(root))
        draw("trace", programs, root, root / "docs/pictures/trace.svg")
        return 0
    problems = [] if beside.read_text() == hash_of_sources(root) else [STALE.format("report.png")]
    with tempfile.TemporaryDirectory() as folder:
        for name in ("age", "top", "trace"):
            drawn = pathlib.Path(folder) / f"{name}.svg"
            draw(name, programs, root, drawn)
            if drawn.read_bytes() != (root / "docs/pictures" / drawn.name).read_bytes():
                problems.append(STALE.format(drawn.name))
    print("\n".join(problems) or "the pictures are today's")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
