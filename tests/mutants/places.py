# SPDX-License-Identifier: Apache-2.0
"""Where a source can be mutated, found in clang's tree of it.

Operators: relational (< is <=, == is !=, a counting loop leaves out its last round), negate (a condition, an operand of && or ||,
a returned truth), constant (plus and minus one, a truth flipped), delete (a statement). Left alone: what the compiler needs as a
constant, declarations, heads of range loops, and calls that only trace or log.
"""
import dataclasses
import os
import re
import shlex
import zlib

import clang.cindex
from clang.cindex import CursorKind as Kind

FUNCTIONS = {Kind.FUNCTION_DECL, Kind.CXX_METHOD, Kind.CONSTRUCTOR, Kind.DESTRUCTOR, Kind.CONVERSION_FUNCTION, Kind.FUNCTION_TEMPLATE}
RELATIONS = {b"<": ("less", "<="), b"<=": ("less_equal", "<"), b">": ("greater", ">="), b">=": ("greater_equal", ">"),
             b"==": ("equal", "!="), b"!=": ("not_equal", "==")}
BODIES = {Kind.COMPOUND_STMT, Kind.IF_STMT, Kind.FOR_STMT, Kind.CXX_FOR_RANGE_STMT, Kind.WHILE_STMT, Kind.CASE_STMT, Kind.DEFAULT_STMT}
LITERALS = {Kind.INTEGER_LITERAL, Kind.FLOATING_LITERAL}
NAMES = {Kind.DECL_REF_EXPR, Kind.MEMBER_REF_EXPR, Kind.TYPE_REF, Kind.TEMPLATE_REF}
ONLY_TOLD = re.compile(rb"(trace::|spdlog::|log::|fmt::print|\(void\))|.*\.reserve\(")


@dataclasses.dataclass(frozen=True)
class Edit:
    """Text put in front of `start` and behind `end`; between `cut` (an operator) replaced. Offsets in bytes."""
    start: int
    end: int
    before: str
    after: str
    cut: tuple = ()  # (from, to, instead)


@dataclasses.dataclass(frozen=True)
class Mutant:
    file: str
    line: int
    function: str
    operator: str
    change: str  # text => text; #2: the second of its kind in this function

    @property
    def key(self):
        return f"{self.file} | {self.function} | {self.operator} | {self.change}"

    @property
    def id(self):
        return f"{zlib.crc32(self.key.encode()):08x}"


@dataclasses.dataclass
class Function:
    name: str
    start: int
    end: int


@dataclasses.dataclass
class Places:
    """Of one file."""
    functions: list
    mutants: list
    edits: list


def squeezed(text, most=90):
    text = re.sub(r"\s+", " ", re.sub(r"//[^\n]*", "", text.decode())).strip()
    return text if len(text) <= most else text[:most - 8] + f"~{zlib.crc32(text.encode()):08x}"[:8]


class Finder:
    """Of one file in one translation unit."""

    def __init__(self, path, source):
        self.path, self.source = path, source
        self.found = Places([], [], [])
        self.counts = {}
        self.function = ""

    def text(self, cursor):
        return self.source[cursor.extent.start.offset:cursor.extent.end.offset]

    def mutant(self, cursor, operator, change):
        whole = (self.function, operator, change)
        self.counts[whole] = self.counts.get(whole, 0) + 1
        if self.counts[whole] > 1:
            change += f" #{self.counts[whole]}"
        made = Mutant(self.path, cursor.extent.start.line, self.function, operator, change)
        self.found.mutants.append(made)
        return f"0x{made.id}U"

    def wrap(self, cursor, before, after, cut=()):
        self.found.edits.append(Edit(cursor.extent.start.offset, cursor.extent.end.offset, before, after, cut))

    def visit_function(self, cursor):
        body = next((child for child in cursor.get_children() if child.kind == Kind.COMPOUND_STMT), None)
        if body is None or b"consteval" in self.source[cursor.extent.start.offset:cursor.location.offset]:
            return
        names, parent = [cursor.spelling], cursor.semantic_parent
        while parent is not None and parent.kind in (Kind.CLASS_DECL, Kind.STRUCT_DECL, Kind.CLASS_TEMPLATE):
            names.insert(0, parent.spelling)
            parent = parent.semantic_parent
        self.function = "::".join(names)
        self.found.functions.append(Function(self.function, cursor.extent.start.offset, cursor.extent.end.offset))
        self.visit(body, cursor)

    def visit(self, cursor, parent):
        kind = cursor.kind
        children = list(cursor.get_children())
        if kind == Kind.STATIC_ASSERT or kind == Kind.CXX_UNARY_EXPR:  # sizeof
            return
        if kind == Kind.DECL_STMT and re.match(rb"(static\s+)?(inline\s+)?constexpr\b|static\b", self.text(cursor)):
            return
        self.delete(cursor, parent)
        self.conditions(cursor, children)
        self.relation(cursor, parent, children)
        self.literal(cursor, parent)
        for child in self.chosen(cursor, children):
            self.visit(child, parent if kind in (Kind.UNEXPOSED_EXPR, Kind.PAREN_EXPR) and parent.kind not in BODIES else cursor)

    def chosen(self, cursor, children):
        """The children that run."""
        if cursor.kind == Kind.CXX_FOR_RANGE_STMT:
            return children[-1:]
        if cursor.kind == Kind.CASE_STMT:
            return children[1:]
        if cursor.kind == Kind.VAR_DECL:  # a type's numbers stand in front of the name
            return [child for child in children if child.extent.start.offset > cursor.location.offset]
        if cursor.kind == Kind.IF_STMT and re.match(rb"if\s+(constexpr|consteval)", self.text(cursor)):
            return [child for child in children if not child.kind.is_expression()]
        return children

    def delete(self, cursor, parent):
        if parent.kind not in BODIES or not cursor.kind.is_expression():
            return
        text = self.text(cursor)
        semicolon = re.match(rb"\s*;", self.source[cursor.extent.end.offset:])
        if not semicolon or ONLY_TOLD.match(text):
            return
        if parent.kind == Kind.FOR_STMT and list(parent.get_children())[-1] != cursor:
            return
        made = self.mutant(cursor, "delete", squeezed(text) + ";")
        end = cursor.extent.end.offset + semicolon.end()
        self.found.edits.append(Edit(cursor.extent.start.offset, end, f"{{ if (!::takt_mutant::on({made})) {{ ", " } }"))

    def conditions(self, cursor, children):
        kind = cursor.kind
        if kind == Kind.IF_STMT and not re.match(rb"if\s+(constexpr|consteval)", self.text(cursor)):
            first = 1 if children and children[0].kind == Kind.DECL_STMT else 0
            if len(children) > first and children[first].kind.is_expression():
                self.negate(children[first], cursor)
        elif kind in (Kind.WHILE_STMT, Kind.CONDITIONAL_OPERATOR) and children and children[0].kind.is_expression():
            self.negate(children[0], cursor)
        elif kind == Kind.BINARY_OPERATOR and cursor.spelling in ("&&", "||"):
            for child in children:
                self.negate(child, cursor)
        elif kind == Kind.RETURN_STMT and children and children[0].type.get_canonical().spelling == "bool":
            self.negate(children[0], cursor)

    def negate(self, cursor, whole):
        if cursor.extent == whole.extent:
            return  # out of a macro
        inner = cursor
        while inner.kind in (Kind.UNEXPOSED_EXPR, Kind.PAREN_EXPR) and len(list(inner.get_children())) == 1:
            inner = next(inner.get_children())
        if inner.kind == Kind.CXX_BOOL_LITERAL_EXPR:
            return
        if inner.kind == Kind.BINARY_OPERATOR and inner.spelling in ("&&", "||", "==", "!="):
            return  # their own mutants say the same
        text = self.text(cursor)
        if not text or not re.search(rb"[\w)\]]$", text) or re.search(rb"[=!]=", text):
            return
        made = self.mutant(cursor, "negate", squeezed(text))
        self.wrap(cursor, f"::takt_mutant::negated({made}, static_cast<bool>(", "))")

    def relation(self, cursor, parent, children):
        sides = None
        if cursor.kind == Kind.BINARY_OPERATOR and len(children) == 2:
            sides = children
        elif cursor.kind == Kind.CALL_EXPR and len(children) == 3 and self.text(children[1]) in RELATIONS:
            sides = [children[0], children[2]]
        if not sides:
            return
        gap = (sides[0].extent.end.offset, sides[1].extent.start.offset)
        operator = self.source[gap[0]:gap[1]].strip()
        if operator not in RELATIONS or gap[0] >= gap[1] or cursor.extent.start.offset != sides[0].extent.start.offset:
            return
        name, instead = RELATIONS[operator]
        if parent.kind == Kind.FOR_STMT:
            if operator != b"<":
                return
            name, instead = "all_but_last", "all but the last"
        made = self.mutant(cursor, "relational", f"{squeezed(self.text(cursor))} => {instead}")
        self.wrap(cursor, f"::takt_mutant::{name}({made}, ", ")", (gap[0], gap[1], ", "))

    def literal(self, cursor, parent):
        if parent.kind in NAMES:
            return
        text = self.text(cursor)
        if cursor.kind == Kind.CXX_BOOL_LITERAL_EXPR and text in (b"true", b"false"):
            made = self.mutant(cursor, "constant", f"{self.around(cursor)}: {text.decode()} flipped")
            self.wrap(cursor, f"::takt_mutant::flipped({made}, ", ")")
        if cursor.kind not in LITERALS or not re.fullmatch(rb"[0-9][0-9a-fA-FxXuUlLfF.'e+-]*", text):
            return
        where = self.around(cursor)
        plus = self.mutant(cursor, "constant", f"{where}: {text.decode()} + 1")
        minus = self.mutant(cursor, "constant", f"{where}: {text.decode()} - 1")
        self.wrap(cursor, f"::takt_mutant::shifted({plus}, {minus}, ", ")")

    def around(self, cursor):
        """The line that the literal is on: a number alone says little."""
        start = self.source.rfind(b"\n", 0, cursor.extent.start.offset) + 1
        end = self.source.find(b"\n", cursor.extent.end.offset)
        return squeezed(self.source[start:end])


def arguments_of(entry, root, tree):
    """A compile command's macros and include folders, read from the checkout instead of the tree that is rewritten."""
    words = shlex.split(entry["command"])
    kept = []
    for i, word in enumerate(words):
        if word == "-isystem":
            kept.append("-isystem" + words[i + 1])
        elif word.startswith(("-I", "-D", "-std=", "-isystem")) and word != "-isystem":
            kept.append(f"-I{root}" if word == f"-I{tree}" else word)
    return kept


def places_of_unit(root, tree, entry, wanted):
    """The places in the wanted files (relative paths) that one translation unit shows: {path: Places}."""
    path = os.path.relpath(entry["file"], tree)
    unit = clang.cindex.Index.create().parse(os.path.join(root, path), args=arguments_of(entry, root, tree))
    errors = [str(one) for one in unit.diagnostics if one.severity >= clang.cindex.Diagnostic.Error]
    if errors:
        raise ValueError(f"clang does not understand {path}: {errors[0]}")
    finders = {}

    def walk(cursor):
        for child in cursor.get_children():
            if child.location.file is None:
                continue
            name = os.path.relpath(child.location.file.name, root)
            if name not in wanted:
                continue
            if child.kind in FUNCTIONS and child.is_definition():
                if name not in finders:
                    with open(os.path.join(root, name), "rb") as file:
                        finders[name] = Finder(name, file.read())
                finders[name].visit_function(child)
            elif child.kind in (Kind.NAMESPACE, Kind.CLASS_DECL, Kind.STRUCT_DECL, Kind.CLASS_TEMPLATE):
                walk(child)

    walk(unit.cursor)
    return {name: finder.found for name, finder in finders.items()}
