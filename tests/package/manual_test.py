#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Goal: manual pages and completion say what the programs' --help says, all of it, and are well-formed. Method: they are
made anew from this build, whose help has no sentence of more than 25 words; every command is found by asking the programs (not by the generator), every word of every
help text is looked for in its rendered page, `man` is asked for warnings, and real shells complete lines: bash and fish;
zsh, which completes on a terminal only, runs the function with its own two words for offering replaced.
Usage: manual_test.py MANUAL.py BIN_DIR. Exit codes: 0 fine, 1 not, 77 man or bash is not installed.
"""
import importlib.util
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

PROGRAMS = ("takt", "takt-executive", "takt-policy-host", "takt-plant", "takt-monitor", "takt-imu", "takt-ros-sensors",
            "takt-policy-bridge", "takt-policy-server")
# Line so far (the last word is being completed) -> must be offered, must not.
LINES = [
    ("takt pan", {"panel"}, {"plant"}),
    ("takt panel ", {"run", "merge", "attest"}, {"audit"}),
    ("takt panel run --w", {"--workers"}, {"--watch"}),
    ("takt bus di", {"disable"}, {"stop"}),
    ("takt bus watch --robot x.yaml --s", {"--seconds"}, {"--store"}),
    ("takt-executive --allow", {"--allow-non-realtime"}, set()),
    ("takt-plant --sce", {"--scenario"}, set()),
]


def help_of(bin_dir, words):
    return subprocess.run([bin_dir / words[0], *words[1:], "--help"], check=True, capture_output=True, text=True).stdout


def subcommands(text):
    """Under whichever title, without their aliases."""
    titled = re.findall(r"^([A-Z][\w, -]+):\n((?:  .*\n)+)", text + "\n", re.M)
    return [name for title, below in titled if title not in ("Options", "Positionals") and not title.startswith("Example")
            for name in re.findall(r"^  ([^\s,]+)", below, re.M)]


def rendered(page):
    done = subprocess.run(["man", "--warnings=w", "-E", "UTF-8", "-l", "--nj", "--nh", str(page)], capture_output=True, text=True,
                          env=dict(os.environ, MANWIDTH="200", LC_ALL="C.UTF-8", MANROFFOPT=""))
    return done.stdout, done.stderr.strip()


def words_of(text):
    """What a reader looks for; layout and column breaks apart."""
    return set(re.findall(r"[\w-]{4,}", re.sub(r"^\[Option Group.*\n.*|^Usage:.*|^[A-Z][\w, -]+:$", "", text, flags=re.M)))


def page_problems(out, bin_dir, words):
    name = "-".join(words) + ".1.gz"
    page = next((folder / name for folder in (out / "man/man1", out / "lab/man/man1") if (folder / name).exists()), None)
    if page is None:
        return [f"no page for {' '.join(words)}"]
    text, warnings = rendered(page)
    problems = [f"{page.name}: {warnings}"] if warnings else []
    pending = [words]
    while pending:
        command = pending.pop()
        said = help_of(bin_dir, command)
        if len(words) > 1 or len(command) == 1:
            missing = sorted(word for word in words_of(said) if word not in text and not re.search(r"\b[A-Z]+\b", word)
                             and word not in ("Options", "Positionals", "Subcommands", "Example", "Examples", "Exit", "codes"))
            problems += [f"{page.name} lacks, of {' '.join(command)} --help: {', '.join(missing)}"] if missing else []
        if len(words) > 1:
            pending += [command + [name] for name in subcommands(said)]
    return problems


def completed(out, line):
    words = line.split(" ")
    script = (f"source {out}/bash-completion/completions/takt\nCOMP_WORDS=({' '.join(repr(word) for word in words)})\n"
              f"COMP_CWORD={len(words) - 1}\n_takt\nprintf '%s\\n' \"${{COMPREPLY[@]}}\"\n")
    return set(subprocess.run(["bash", "-c", script], check=True, capture_output=True, text=True).stdout.split())


def completed_by_fish(out, line):
    program = line.split()[0]
    script = f"source {out}/fish/vendor_completions.d/{program}.fish; complete -C {line!r}"
    done = subprocess.run(["fish", "--no-config", "-c", script], check=True, capture_output=True, text=True)
    return {offer.split("\t")[0] for offer in done.stdout.splitlines()} | ({done.stderr} if done.stderr else set())


def completed_by_zsh(out, line):
    words = line.split(" ")
    script = (f"compdef() {{ :; }}\n_files() {{ :; }}\n_describe() {{ print -l -- ${{${{(P)@[-1]}}%%:*}}; }}\n"
              f"words=({' '.join(map(repr, words))}) CURRENT={len(words)} PREFIX={words[-1]!r}\nsource {out}/zsh/vendor-completions/_takt\n")
    offered = subprocess.run(["zsh", "-f", "-c", script], check=True, capture_output=True, text=True).stdout.split()
    return {word for word in offered if word.startswith(words[-1])}


def robot_page_problems(out, bin_dir):
    """Every key of the reference is a term of takt.robot(5)."""
    text, warnings = rendered(out / "man/man5/takt.robot.5.gz")
    table = subprocess.run([bin_dir / "takt", "config", "keys"], check=True, capture_output=True, text=True).stdout
    keys = re.findall(r"^\| `([^`]+)`", table, re.M)
    missing = [key for key in keys if not re.search(rf"^ +{re.escape(key)}( |$)", text, re.M)]
    return ([f"takt.robot.5: {warnings}"] if warnings else []) + [f"takt.robot(5) lacks {key}" for key in missing] + (
        [] if len(keys) > 100 else [f"only {len(keys)} keys"])


def long_sentences(generator, bin_dir):
    """No sentence of a help text has more than 25 words; a semicolon ends one there."""
    spec = importlib.util.spec_from_file_location("manual", generator)
    manual = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(manual)
    pending = [manual.Help(bin_dir, [program]) for program in PROGRAMS]
    while pending:
        command = pending.pop()
        texts = [command.summary, *command.notes, *(meaning for terms in command.sections.values() for _, meaning in terms)]
        for sentence in (sentence for text in texts for sentence in re.split(r"(?<=[.;]) ", text)):
            if len(re.findall(r"\S*\w\S*", sentence)) > 25:
                yield f"{command.name} --help: more than 25 words: {sentence}"
        pending += command.children


def main():
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 64
    if not shutil.which("man") or not shutil.which("bash"):
        print("SKIPPED: man-db is not installed: NO PAGE WAS TESTED")
        return 77
    generator, bin_dir = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
    with tempfile.TemporaryDirectory(prefix="takt-manual.") as folder:
        out = pathlib.Path(folder)
        subprocess.run([generator, bin_dir, "0", out], check=True)
        commands = [[program] for program in PROGRAMS] + [["takt", name] for name in subcommands(help_of(bin_dir, ["takt"]))]
        problems = [problem for words in commands for problem in page_problems(out, bin_dir, words)]
        problems += robot_page_problems(out, bin_dir)
        problems += long_sentences(generator, bin_dir)
        for shell, complete in (("bash", completed), ("fish", completed_by_fish), ("zsh", completed_by_zsh)):
            if not shutil.which(shell):
                print(f"SKIPPED: {shell} is not installed: ITS COMPLETION WAS NOT TESTED")
                continue
            for line, wanted, unwanted in LINES:
                offered = complete(out, line)
                if not wanted <= offered or unwanted & offered:
                    problems.append(f"{shell}: completing `{line}` offers {sorted(offered)}")
    print("\n".join(problems) or f"{len(commands)} pages say what --help says")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
