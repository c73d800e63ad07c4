#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Manual pages and shell completion out of the programs' own --help: manual.py BIN_DIR VERSION OUT_DIR

Writes OUT_DIR/man/man1/*.1.gz, one page per program and per first-level subcommand of takt (takt-run.1: takt run),
man5/takt.robot.5.gz out of `takt config keys`, OUT_DIR/bash-completion/completions/takt with links for the other
programs, zsh/vendor-completions/_takt and fish/vendor_completions.d/*.fish. Pages of commands that program takt-lab carries lie in
OUT_DIR/lab/man/man1; where it was not built, they and their completion are left out. Nothing is written by hand, so nothing can
name an option that is gone. The same input gives the same bytes. Exit codes: 0 written; 1 a program's help is missing
an example or its exit codes; 64 command line.
"""
import gzip
import os
import pathlib
import re
import subprocess
import sys

PROGRAMS = ("takt", "takt-executive", "takt-policy-host", "takt-plant", "takt-monitor", "takt-imu", "takt-ros-sensors",
            "takt-policy-bridge", "takt-policy-server")
COLUMN = 30  # CLI11's
SECTIONS = ("Positionals:", "Options:", "Subcommands:")
UNAVAILABLE = 69
LAB = "Evaluate, by package takt-lab:"
BY_NAME = ("More:", LAB)  # lists of takt's own subcommands: names alone, and with a line for each
TITLES = ("Run a robot:", "Set one up:", "Look at runs:", "Help:", *BY_NAME)


class Help:
    """What one program or subcommand says of itself."""

    def __init__(self, bin_dir, words):
        self.words = words
        text = subprocess.run([bin_dir / words[0], *words[1:], "--help"], check=True, capture_output=True, text=True,
                              env=dict(os.environ, LC_ALL="C.UTF-8", COLUMNS="100")).stdout
        self.text = text.replace(str(bin_dir) + "/", "")
        before, self.usage, after = re.split(r"^Usage: (.*)\n", self.text, maxsplit=1, flags=re.M)
        self.summary, _, more = before.strip().partition("\n")
        self.sections, footer = entries(after)
        self.notes, self.example, self.exit_codes = sort_footer(more.splitlines() + footer)
        by_name = {heading: [name for names, _ in self.sections.pop(heading, []) for name in names.split(", ")] for heading in BY_NAME}
        self.of_lab = set(by_name[LAB])
        commands = [entry for heading in list(self.sections) if heading not in SECTIONS[:2] for entry in self.sections.pop(heading)]
        names = [name.partition(",")[0] for name, _ in commands] + [name for names in by_name.values() for name in names]  # without aliases
        self.children = [Help(bin_dir, words + [name]) for name in names if is_there(bin_dir, words + [name])]
        commands += [(child.words[-1], child.summary) for child in self.children if any(child.words[-1] in names for names in by_name.values())]
        if commands:
            self.sections["Subcommands:"] = commands

    @property
    def name(self):
        return " ".join(self.words)

    def options(self):
        """Every --option and -o it takes."""
        words = [term.split()[0] for term, _ in self.sections.get("Options:", [])]
        return sorted(option for word in words if word.startswith("-") for option in word.split(","))

    def problems(self):
        own = []
        if not self.children:
            own += [] if self.example else [f"{self.name} --help has no example"]
            own += [] if self.exit_codes else [f"{self.name} --help does not say its exit codes"]
        return own + [problem for child in self.children for problem in child.problems()]


def is_there(bin_dir, words):
    """Not so what takt-lab carries, where that was not built."""
    return subprocess.run([bin_dir / words[0], *words[1:], "--help"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL).returncode != UNAVAILABLE


def entries(text):
    """({section: [(term, meaning)]}, footer lines). Entries of an option group are options too, and what the group
    demands ("Exactly 1 of the following options is required") is an entry of its own without a meaning."""
    found, section, footer = {}, None, []
    lines = text.splitlines()
    for line, below in zip(lines, lines[1:] + [""]):
        heading = line.strip()
        if heading in SECTIONS + TITLES:
            section = heading
        elif heading.startswith("[Option Group"):
            section = "Options:"
        elif section and re.match(r" {10,}\S", line):
            term, meaning = found[section][-1]
            found[section][-1] = (term, f"{meaning} {heading}".strip())
        elif section and re.match(r" {2,4}\S", line):
            # Meanings begin at one column; the meaning of a term that reaches it stands on the next line.
            column = COLUMN + len(line) - len(line.lstrip()) - 2
            is_long = line[column - 1:column].strip() or re.match(rf" {{{column}}}\S", below)
            term, meaning = (line, "") if is_long else (line[:column], line[column:])
            if section != "Options:" or heading.startswith("-"):
                found.setdefault(section, []).append((term.strip(), meaning.strip()))
            elif heading.startswith("["):
                found.setdefault(section, []).append((heading.strip("[]"), ""))
        elif heading:
            section = None
            footer.append(line)
    return found, footer


def sort_footer(lines):
    """(notes, example lines, exit codes), by how the lines begin; a line that begins in no such way goes on."""
    notes, example, codes = [], [], []
    into = notes
    for line in lines:
        begin = re.match(r"(Examples?|Exit codes): ?(.*)", line)
        if begin:
            into = codes if begin[1] == "Exit codes" else example
            line = begin[2]
        elif into is example and not line.startswith(" "):
            into = notes
        if line.strip():
            into.append(line.strip())
    return notes, example, codes


def escape(text):
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\\&" + text if text.startswith((".", "'")) else text


def term_line(term):
    return ".TP\n\\fB" + escape(term) + "\\fR"


def body(help_, section, sub):
    """The part of a page that describes one command; `section` is .SH or, below a page's own, .SS."""
    parts = [f"{section} {'DESCRIPTION' if not sub else escape(help_.name)}", escape(help_.summary)]
    parts += [".PP\n" + "\n".join(escape(line) for line in help_.notes)] if help_.notes else []
    if sub:
        parts.append(".PP\n.B " + escape(help_.usage))
    for heading, title in zip(SECTIONS, ("ARGUMENTS", "OPTIONS", "COMMANDS")):
        if heading in help_.sections:
            parts.append(f".SH {title}" if not sub else ".PP")
            parts += [f"{term_line(term)}\n{escape(meaning) or chr(92) + '&'}" for term, meaning in help_.sections[heading]]
    for title, lines in (("EXAMPLES", help_.example), ("EXIT STATUS", help_.exit_codes)):
        if lines:
            parts.append(f".SH {title}" if not sub else f".PP\n.I {'Example' if title == 'EXAMPLES' else 'Exit status'}")
            text = "\n".join(escape(line) for line in lines)
            parts.append(f".PP\n.nf\n{text}\n.fi" if title == "EXAMPLES" else f".PP\n{text}")
    return parts + [part for child in help_.children if len(help_.words) > 1 for part in body(child, ".SS", True)]


def page(help_, version, everyone):
    title = "-".join(help_.words)
    others = sorted("-".join(other.words) for other in everyone if other is not help_)
    parts = [f".TH {title.upper()} 1 \"\" \"Takt {version}\" \"Takt\"",
             ".\\\" Generated from --help.",
             f".SH NAME\n{escape(title)} \\- {escape(help_.summary.rstrip('.'))}",
             f".SH SYNOPSIS\n.B {escape(help_.usage)}"]
    parts += body(help_, ".SH", False)
    parts.append(".SH SEE ALSO\n" + ",\n".join(f".BR {escape(other)} (1)" for other in others).replace(" (1),", " (1),"))
    return "\n".join(parts) + "\n"


def completion(helps):
    """One case per command; below it what may come next."""
    def cases(help_):
        children = [child.words[-1] for child in help_.children]
        yield f"    '{help_.name}') words='{' '.join(children + help_.options())}' ;;"
        for child in help_.children:
            yield from cases(child)

    def paths(help_):
        for child in help_.children:
            yield child.name
            yield from paths(child)

    known = "|".join(f"'{path}'" for help_ in helps for path in paths(help_))
    return "\n".join([
        "# Generated from --help. Options and subcommands; everything else completes as file names.",
        "_takt() {",
        "  local cur=${COMP_WORDS[COMP_CWORD]} path=${COMP_WORDS[0]##*/} word words=''",
        "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do",
        f"    case \"$path $word\" in {known}) path=\"$path $word\" ;; esac",
        "  done",
        "  case \"$path\" in",
        *[line for help_ in helps for line in cases(help_)],
        "  esac",
        "  COMPREPLY=()",
        "  case \"$words\" in -*) [ \"${cur#-}\" != \"$cur\" ] || return 0 ;; esac",
        "  mapfile -t COMPREPLY < <(compgen -W \"$words\" -- \"$cur\")",
        "}",
        f"complete -o bashdefault -o default -F _takt {' '.join(PROGRAMS)}", ""])


def walk(helps):
    for help_ in helps:
        yield help_
        yield from walk(help_.children)


def quoted(text):
    """For zsh and fish."""
    return "'" + text.replace("'", "’").replace("\\", "") + "'"


def option_entries(help_):
    """(names, takes a value, meaning) of each option."""
    for term, meaning in help_.sections.get("Options:", []):
        names = term.split()[0].split(",")
        if names[0].startswith("-"):
            yield names, len(term.split()) > 1, meaning


def zsh_completion(helps):
    def described(name, meaning):
        return quoted(f"{name}:{meaning.replace(':', ' -')}")

    lines = ["#compdef " + " ".join(PROGRAMS), "# Generated from --help. Options and subcommands; everything else completes as file names.",
             "_takt() {", "  local at=${words[1]:t} word", "  local -a commands options",
             '  for word in "${(@)words[2,CURRENT-1]}"; do', '    case "$at $word" in']
    known = [quoted(child.name) for help_ in walk(helps) for child in help_.children]
    lines += [f"      ({'|'.join(known)}) at=\"$at $word\" ;;", "    esac", "  done", '  case "$at" in']
    for help_ in walk(helps):
        commands = [described(child.words[-1], child.summary.rstrip(".")) for child in help_.children]
        options = [described(name, meaning) for names, _, meaning in option_entries(help_) for name in names]
        lines.append(f"    ({quoted(help_.name)}) commands=({' '.join(commands)}); options=({' '.join(options)}) ;;")
    lines += ["  esac", "  if [[ $PREFIX == -* ]]; then", "    _describe -o option options",
              "  elif (( $#commands )); then", "    _describe command commands", "  else", "    _files", "  fi", "}",
              '_takt "$@"', ""]
    return "\n".join(lines)


def fish_completion(helps, program):
    """Each program's own file: fish looks for PROGRAM.fish."""
    own = list(walk([help_ for help_ in helps if help_.name == program]))
    function = "__" + program.replace("-", "_") + "_at"
    known = " ".join(quoted(child.name) for help_ in own for child in help_.children)
    lines = ["# Generated from --help. Options and subcommands; everything else completes as file names.", f"function {function}",
             f"  set -l at {program}", "  for word in (commandline -opc)[2..-1]"]
    lines += ['    switch "$at $word"', f"      case {known}", '        set at "$at $word"', "    end"] if known else []
    lines += ["  end", '  test "$at" = "$argv"', "end"]
    for help_ in own:
        begin = f"complete -c {program} -n {quoted(f'{function} {help_.name}')}"
        lines += [f"{begin} -f -a {child.words[-1]} -d {quoted(child.summary.rstrip('.'))}" for child in help_.children]
        for names, takes_value, meaning in option_entries(help_):
            spelt = " ".join(f"-l {name[2:]}" if name.startswith("--") else f"-s {name[1:]}" for name in names)
            lines.append(f"{begin} {spelt}{' -r' if takes_value else ''} -d {quoted(meaning)}")
    return "\n".join(lines) + "\n"


def robot_page(bin_dir, version):
    """takt.robot(5): the key table."""
    table = subprocess.run([bin_dir / "takt", "config", "keys"], check=True, capture_output=True, text=True).stdout
    rows = [[cell.strip() for cell in line.strip("|").split(" | ")] for line in table.splitlines()[2:]]
    parts = [f".TH TAKT.ROBOT 5 \"\" \"Takt {version}\" \"Takt\"", ".\\\" Generated from takt config keys.",
             ".SH NAME\ntakt.robot \\- file that describes a robot to Takt",
             ".SH DESCRIPTION\n" + escape("One YAML file describes one robot: its buses, drives, limits, policy and contract. "
             "A quantity is a number and a unit, such as 120 ms, 250ms, 30deg or 18 Nm; a missing or wrong unit is an error. "
             "Anchors, aliases, merge keys, tags and tabs are refused, and so is a key that is not listed here."),
             ".PP\n" + escape("takt config check FILE names what is wrong with one; takt config schema prints a JSON Schema for "
             "editors."), ".SH KEYS\n" + escape("[] stands for an entry of a list, NAME for a name of your own.")]
    for key, values, meaning in rows:
        value, _, otherwise = values.partition("; `")
        default = f"default: {otherwise.rstrip('`')}" if otherwise else "required"
        parts.append(f"{term_line(key.strip('`'))}\n{escape(f'{meaning[:1].upper()}{meaning[1:]}. Value: {value}; {default}.')}")
    parts.append(".SH SEE ALSO\n.BR takt\\-config (1),\n.BR takt\\-run (1)")
    return "\n".join(parts) + "\n"


def write(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)


def main():
    if len(sys.argv) != 4:
        print(__doc__, file=sys.stderr)
        return 64
    bin_dir, version, out = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2], pathlib.Path(sys.argv[3])
    programs = [Help(bin_dir, [program]) for program in PROGRAMS if (bin_dir / program).exists()]
    problems = [problem for help_ in programs for problem in help_.problems()]
    if problems:
        print("\n".join(problems), file=sys.stderr)
        return 1
    pages = programs + programs[0].children
    for folder in (out / "man/man1", out / "lab/man/man1"):
        folder.mkdir(parents=True, exist_ok=True)
        for old in folder.iterdir():
            old.unlink()
    for help_ in pages:
        of_lab = help_.words[-1] in programs[0].of_lab
        path = out / ("lab/man/man1" if of_lab else "man/man1") / ("-".join(help_.words) + ".1.gz")
        path.write_bytes(gzip.compress(page(help_, version, pages).encode(), 9, mtime=0))
    # They run the commands that `takt` hands on: same pages.
    for path in (out / "man/man1/takt-operate.1.gz", out / "lab/man/man1/takt-lab.1.gz"):
        path.write_bytes(gzip.compress(b".so man1/takt.1\n", 9, mtime=0))
    folder = out / "bash-completion/completions"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "takt").write_text(completion(programs))
    for other in PROGRAMS[1:]:
        (folder / other).unlink(missing_ok=True)
        (folder / other).symlink_to("takt")
    write(out / "zsh/vendor-completions/_takt", zsh_completion(programs).encode())
    for program in (help_.name for help_ in programs):
        write(out / f"fish/vendor_completions.d/{program}.fish", fish_completion(programs, program).encode())
    write(out / "man/man5/takt.robot.5.gz", gzip.compress(robot_page(bin_dir, version).encode(), 9, mtime=0))
    return 0


if __name__ == "__main__":
    sys.exit(main())
