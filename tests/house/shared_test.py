#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: CI notices that published models and policies are missing. Method: every test that names the folder `shared`
beside the checkout must fail, not skip, where TAKT_REQUIRE_SHARED is set: C++ by TAKT_NEEDS_SHARED, others by asking
for the variable themselves. And .ci/run sets it.

Argument: source folder."""
import pathlib
import re
import sys

source = pathlib.Path(sys.argv[1])
problems = []
for file in sorted(source.glob("tests/**/*")):
    if file.suffix not in (".cpp", ".hpp", ".py", ".sh") or "tests/bench/" in str(file) or file.parent.name == "house":
        continue
    text = file.read_text(errors="replace")
    code = re.sub(r"//.*|\"\"\".*?\"\"\"", "", text, flags=re.S if file.suffix == ".py" else 0)
    if not re.search(r"\.\./shared|/ \"shared\"|has no published|IS ABSENT", code):
        continue
    is_helper = file.name == "published_g1.hpp"  # names the files; who includes it asks
    if not is_helper and not re.search(r"TAKT_NEEDS_SHARED\(|TAKT_REQUIRE_SHARED", text):
        problems.append(f"{file.relative_to(source)} names ../shared and passes or skips without it under TAKT_REQUIRE_SHARED=1")
if "TAKT_REQUIRE_SHARED=1" not in (source / ".ci/run").read_text():
    problems.append(".ci/run does not set TAKT_REQUIRE_SHARED=1")
print("\n".join(problems) or "whatever needs ../shared fails in CI without it")
sys.exit(1 if problems else 0)
