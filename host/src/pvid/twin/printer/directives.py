"""Reads C with its includes, conditions and macros, and keeps what a preprocessor loses: comments and names.

A macro without parameters whose value is a number stays in the text as a name, with KEPT behind it (`Unit.constants`
has its value); all others are replaced. The text has the lines of each file one after the other, and `Unit.places`
leads back to them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pvid.base.errors import PvidError

_TOKEN = re.compile(
    r"""(?P<space>[ \t\n\f]+)|(?P<name>[A-Za-z_]\w*)|(?P<number>\.?\d(?:[eEpP][+-]|[\w.])*)"""
    r"""|(?P<text>"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')|(?P<sign>\#\#|<<=|>>=|->|\+\+|--|<<|>>|<=|>=|==|!=|&&|\|\||[-+*/%&|^]=|.)""",
    re.VERBOSE,
)
KEPT = "__macro"  # behind the name of a macro that stays one, in the text
_COMMENT = re.compile(r'"(?:\\.|[^"\\\n])*"|/\*.*?\*/|//[^\n]*', re.DOTALL)
_OF_A_NUMBER = re.compile(r"[-+*/%()<>&|^~!=?: ]|<<|>>|<=|>=|==|!=|&&|\|\||\d[\w.]*|\.\d\w*|[ \t]+")
_CASTS = re.compile(r"\(\s*(?:u?int(?:8|16|32|64)_t|float|size_t)\s*\)")
_STANDARD = {
    "NULL": "0",
    "INT8_MAX": "127",
    "INT16_MAX": "32767",
    "INT8_MIN": "(-128)",
    "INT16_MIN": "(-32768)",
    "INT32_MAX": "2147483647",
    "INT32_MIN": "(-2147483647 - 1)",
    "INT64_MAX": "9223372036854775807",
    "INT64_MIN": "(-9223372036854775807 - 1)",
    "UINT8_MAX": "255",
    "UINT16_MAX": "65535",
    "UINT32_MAX": "4294967295u",
    "UINT64_MAX": "18446744073709551615u",
    "SIZE_MAX": "18446744073709551615u",
    "bool": "_Bool",
    "INT32_C(x)": "x",
    "UINT32_C(x)": "x ## u",
    "INT64_C(x)": "((int64_t)x)",
    "UINT64_C(x)": "((uint64_t)x)",
}
_EXPANDED = {"NULL", "bool"}  # of those, the ones that do not stay names


class UntranslatedError(PvidError):
    """A construct of C without a translation. The message begins with its file and line."""


@dataclass(frozen=True)
class Macro:
    """body: its tokens. parameters: None, of a macro without parentheses."""

    body: tuple[str, ...]
    parameters: tuple[str, ...] | None = None
    number: bool = False


@dataclass
class Comments:
    """Of a file: by the line on which each ends alone, and by the line whose code it stands behind."""

    alone: dict[int, tuple[int, str]] = field(default_factory=dict)  # last line -> first line, text
    behind: dict[int, str] = field(default_factory=dict)


@dataclass
class Unit:
    """C after its directives.

    Attributes
    ----------
    lines : C that pycparser reads
    places : file and line of each of them
    chunks : of each source, with the headers that nobody has read before: its first line
    constants : name -> C expression of each macro that stays a name
    comments : of every file
    """

    lines: list[str] = field(default_factory=list)
    places: list[tuple[str, int]] = field(default_factory=list)
    constants: dict[str, str] = field(default_factory=dict)
    comments: dict[str, Comments] = field(default_factory=dict)
    chunks: list[int] = field(default_factory=list)

    def texts(self) -> Iterator[tuple[int, str]]:
        """The text of every chunk, by its first line."""
        for first, last in zip(self.chunks, [*self.chunks[1:], len(self.lines)], strict=True):
            yield first, "\n".join(self.lines[first:last]) + "\n"

    def place(self, line: int) -> tuple[str, int]:
        """File and line of a line, counted from 0."""
        return self.places[line] if 0 <= line < len(self.places) else ("?", 0)


class Reader:
    """Reads sources one after the other, as one unit: a header is read once, a source's own macros end with it.

    Parameters
    ----------
    folders : in which headers are looked up, in this order, behind the folder of the file that includes them
    macros : name -> value of the macros that a compiler gets by -D
    texts : name -> text of files that are in no folder, as generated ones; they are found before all others
    """

    def __init__(
        self, folders: Sequence[Path], macros: Mapping[str, str], texts: Mapping[str, str] | None = None
    ) -> None:
        self.unit = Unit()
        self._folders = folders
        self._texts = {Path(name): text for name, text in (texts or {}).items()}
        self._macros: dict[str, Macro] = {}
        self._seen: dict[Path, list[str]] = {}
        for name, value in (_STANDARD | dict(macros)).items():
            self._define(f"{name} {value}")
        for name in _EXPANDED:
            self._macros[name] = Macro(self._macros[name].body)

    def read(self, source: Path) -> None:
        """Adds a source. Raises UntranslatedError at an #error, or a header that is not found."""
        self.unit.chunks.append(len(self.unit.lines))
        before = dict(self._macros)
        own: set[str] = set()
        self._file(source, own)
        for name in own:
            if name in before:
                self._macros[name] = before[name]
            else:
                self._macros.pop(name, None)

    def renamed(self, name: str) -> str:
        """What macros make of a name."""
        return "".join(self._expanded([name], frozenset()))

    # ---- lines

    def _file(self, path: Path, own: set[str] | None) -> None:
        name = str(path)
        if path not in self._seen:
            try:
                text = self._texts[path] if path in self._texts else path.read_text(encoding="utf-8")
            except OSError as error:
                raise UntranslatedError(f"{name}: {error.strerror}") from error
            text = re.sub(r"(?:[^\n]*\\\n)+[^\n]*", _joined, text)
            self.unit.comments[name] = comments = Comments()
            self._seen[path] = _without_comments(text, comments)
        lines = self._seen[path]
        waiting: list[tuple[int, str]] = []
        live: list[tuple[bool, bool]] = []  # is this branch read; has one of them been
        for number, line in enumerate(lines, 1):
            stripped = line.lstrip()
            if not stripped.startswith("#"):
                if all(one for one, _ in live):
                    waiting.append((number, line))
                continue
            self._flush(name, waiting)
            word, _, rest = stripped[1:].strip().partition(" ")
            word, _, more = word.partition("(")
            rest = f"({more}{' ' if rest else ''}{rest}" if more else rest.strip()
            self._directive(path, number, word.strip(), rest, live, own)
        self._flush(name, waiting)

    def _directive(
        self, path: Path, number: int, word: str, rest: str, live: list[tuple[bool, bool]], own: set[str] | None
    ) -> None:
        reads = all(one for one, _ in live)
        if word in ("if", "ifdef", "ifndef"):
            value = reads and (
                self._condition(rest, path, number)
                if word == "if"
                else (rest.split()[0] in self._macros) == (word == "ifdef")
            )
            live.append((value, value or not reads))
        elif word in ("elif", "else"):
            _, done = live.pop()
            outer = all(one for one, _ in live)
            value = outer and not done and (word == "else" or self._condition(rest, path, number))
            live.append((value, done or value))
        elif word == "endif":
            live.pop()
        elif not reads:
            return
        elif word == "define":
            name = self._define(rest)
            if own is not None:
                own.add(name)
        elif word == "undef":
            self._macros.pop(rest.strip(), None)
        elif word == "include":
            self._include(rest, path, number)
        elif word == "error":
            raise UntranslatedError(f"{path}:{number}: {rest}")
        elif word not in ("pragma", "line", ""):
            raise UntranslatedError(f"{path}:{number}: #{word}")

    def _include(self, rest: str, path: Path, number: int) -> None:
        named = rest if rest[:1] in '"<' else "".join(self._expanded(_tokens(rest), frozenset()))
        named = named.strip().replace('\\"', '"')
        if named.startswith("<"):
            return
        name = named.strip('"')
        if Path(name) in self._texts:
            self._file(Path(name), None)
            return
        for folder in (path.parent, *self._folders):
            if (folder / name).is_file():
                self._file((folder / name).resolve(), None)
                return
        raise UntranslatedError(f"{path}:{number}: {name} is not found")

    def _flush(self, name: str, waiting: list[tuple[int, str]]) -> None:
        """The lines so far, with their macros replaced."""
        if waiting:
            first = waiting[0][0]
            whole: list[str] = []
            for number, line in waiting:
                whole += [""] * (number - first - len(whole)) + [line]
            text = "".join(self._expanded(_tokens("\n".join(whole)), frozenset()))
            for number, line in enumerate(text.split("\n"), first):
                self.unit.lines.append(line)
                self.unit.places.append((name, number))
            waiting.clear()

    # ---- macros

    def _define(self, rest: str) -> str:
        match = re.match(r"([A-Za-z_]\w*)(\(([^)]*)\))?\s*(.*)$", rest, re.DOTALL)
        assert match is not None
        name, parameters, body = match[1], match[3], tuple(_tokens(match[4].strip()))
        if match[2] is not None:
            given = tuple(one.strip() for one in parameters.split(",")) if parameters.strip() else ()
            self._macros[name] = Macro(body, given)
            return name
        number = self._is_number(name, body)
        self._macros[name] = Macro(body, None, number)
        return name

    def _is_number(self, name: str, body: tuple[str, ...]) -> bool:
        """Whether a macro may stay a name; registers it."""
        text = _CASTS.sub("", "".join(body)).strip()
        if not text or not any(c.isalnum() for c in text):
            return False
        for token in _tokens(text):
            known = token in self._macros and self._macros[token].number
            if not (known or _OF_A_NUMBER.fullmatch(token)):
                return False
        whole = "".join(one + KEPT if one in self._macros and self._macros[one].number else one for one in body)
        if self.unit.constants.setdefault(name, whole) != whole:
            return False  # another file has another value
        return True

    def _expanded(self, tokens: Sequence[str], hidden: frozenset[str], numbers: bool = False) -> list[str]:
        """Tokens with their macros replaced. numbers: with those that stay names as well."""
        out: list[str] = []
        at = 0
        while at < len(tokens):
            token = tokens[at]
            at += 1
            macro = self._macros.get(token)
            if macro is None or token in hidden or (macro.number and not numbers):
                out.append(token + KEPT if macro is not None and macro.number else token)
                continue
            if macro.parameters is None:
                out += self._expanded(_pasted(macro.body), hidden | {token}, numbers)
                continue
            behind = at
            while behind < len(tokens) and tokens[behind].isspace():
                behind += 1
            if behind == len(tokens) or tokens[behind] != "(":
                out.append(token)
                continue
            given, at = _arguments(tokens, behind)
            pasted = _with_arguments(macro, given, lambda one: self._expanded(one, hidden, numbers))
            out += self._expanded(pasted, hidden | {token}, numbers)
            out += [t for t in tokens[behind:at] if "\n" in t and t.isspace()]  # lines keep their numbers
        return out

    def _condition(self, text: str, path: Path, number: int) -> bool:
        text = re.sub(
            r"\bdefined\s*(?:\(\s*(\w+)\s*\)|(\w+))", lambda m: str(int((m[1] or m[2]) in self._macros)), text
        )
        whole = "".join(self._expanded(_tokens(text), frozenset(), numbers=True))
        whole = re.sub(r"\b[A-Za-z_]\w*\b", "0", re.sub(r"\b(0[xX][0-9a-fA-F]+|\d+)[uUlL]+\b", r"\1", whole))
        whole = re.sub(r"!(?!=)", " not ", whole).replace("&&", " and ").replace("||", " or ").replace("/", "//")
        try:
            return bool(eval(whole.strip(), {"__builtins__": {}}))
        except (SyntaxError, TypeError, ZeroDivisionError) as error:
            raise UntranslatedError(f"{path}:{number}: #if {text}") from error


def _joined(match: re.Match[str]) -> str:
    """A line of several, behind which as many are empty."""
    lines = match[0].split("\\\n")
    return "".join(lines) + "\n" * (len(lines) - 1)


def _without_comments(text: str, comments: Comments) -> list[str]:
    """The lines of a file, whose comments it keeps."""

    def taken(match: re.Match[str]) -> str:
        whole = match[0]
        if whole.startswith('"'):
            return whole
        first = text.count("\n", 0, match.start()) + 1
        last = first + whole.count("\n")
        before = text[text.rfind("\n", 0, match.start()) + 1 : match.start()]
        body = whole[2:].removesuffix("*/") if whole.startswith("/*") else whole[2:]
        lines = [re.sub(r"^\s*\* ?", "", one) if k else one for k, one in enumerate(body.strip("\n").split("\n"))]
        said = "\n".join(one.rstrip() for one in lines).strip()
        if before.strip():
            comments.behind[first] = said
        else:
            comments.alone[last] = (first, said)
        return " " + "\n" * whole.count("\n")

    return _COMMENT.sub(taken, text).split("\n")


def _tokens(text: str) -> list[str]:
    return [match[0] for match in _TOKEN.finditer(text)]


def _arguments(tokens: Sequence[str], at: int) -> tuple[list[list[str]], int]:
    """Arguments of a macro whose opening parenthesis is at `at`; the place behind its closing one."""
    given: list[list[str]] = [[]]
    depth = 0
    while at < len(tokens):
        token = tokens[at]
        at += 1
        if token == "(":
            depth += 1
            if depth == 1:
                continue
        elif token == ")":
            depth -= 1
            if depth == 0:
                return given, at
        elif token == "," and depth == 1:
            given.append([])
            continue
        given[-1].append(" " if token.isspace() else token)
    raise UntranslatedError("a macro's arguments do not end")


def _with_arguments(macro: Macro, given: list[list[str]], expanded: object) -> list[str]:
    assert macro.parameters is not None and callable(expanded)
    places = {name: k for k, name in enumerate(macro.parameters)}
    body = [token for token in macro.body]
    out: list[str] = []
    for k, token in enumerate(body):
        if token == "#" and _near(body, k, 1) in places:
            out.append(_as_text("".join(_trimmed(given[places[_near(body, k, 1)]]))))
        elif token in places and _near(body, k, -1) == "#":
            continue
        elif token in places:
            pasted = "##" in (_near(body, k, -1), _near(body, k, 1))
            one = _trimmed(given[places[token]]) if places[token] < len(given) else []
            out += one if pasted else expanded(one)
        else:
            out.append(token)
    return _pasted(out)


def _as_text(code: str) -> str:
    """#: an argument as a string."""
    return '"' + code.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _trimmed(tokens: list[str]) -> list[str]:
    while tokens and tokens[0].isspace():
        tokens = tokens[1:]
    while tokens and tokens[-1].isspace():
        tokens = tokens[:-1]
    return tokens


def _near(tokens: Sequence[str], at: int, step: int) -> str:
    at += step
    while 0 <= at < len(tokens) and tokens[at].isspace():
        at += step
    return tokens[at] if 0 <= at < len(tokens) else ""


def _pasted(tokens: Sequence[str]) -> list[str]:
    """## joins its neighbours."""
    if "##" not in tokens:
        return list(tokens)
    out: list[str] = []
    joins = False
    for token in tokens:
        if token == "##":
            while out and out[-1].isspace():
                out.pop()
            joins = True
        elif joins and token.isspace():
            continue
        elif joins:
            out[-1] += token
            joins = False
        else:
            out.append(token)
    return out
