"""Two files to copy: pvid_NAME.h and pvid_NAME.c, the core with a mechanism and its rig in one translation unit."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping

from pvid.deploy.cmake import main_of
from pvid.deploy.core_files import includes_of
from pvid.deploy.deployment import Deployment, Files
from pvid.deploy.example import example_files
from pvid.deploy.library import all_files, licence, sources
from pvid.deploy.readme import readme

_OWN_INCLUDE = re.compile(r'^#include "([^"]+)"[^\n]*\n', re.MULTILINE)
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
# At file scope: the name before a parameter list, an array's bounds, a value or the end.
_STATIC = re.compile(
    r"^(?:PVID_(?:NOINLINE|COLD) )?(?:static|PVID_[A-Z_]*INLINE)\s[^;{=(]*?\b(\w+)\s*(?:\(|\[|=|;)", re.MULTILINE
)
_ENUM = re.compile(r"^(?:typedef )?enum\s*\w*\s*\{([^}]*)\}", re.MULTILINE)
_PUBLIC = re.compile(
    r"^(?:PVID_(?:NOINLINE|COLD) )?(?!static|typedef|extern|return)[a-z][\w \*]*?\b(pvid_\w+)\s*(?:\(|\[|=)",
    re.MULTILINE,
)
_MACRO = re.compile(r"^[ \t]*#[ \t]*define (\w+)", re.MULTILINE)
_TEXTS = "pvid/text.h"
_IN_HEADER = ("pvid/record.h", "pvid/standing.h", "pvid/status.h", _TEXTS)
_FIRST = "number/uncontracted.h"
_PART = re.compile(r"A part of \w+\.c\.")


def amalgamated(d: Deployment) -> tuple[str, str]:
    """Header and source.

    The header has the identifier's functions alone. Functions of the core get the mechanism's name in front, so that
    two mechanisms can be in one program; the texts are weak, since both have them.
    """
    files = all_files(d)
    own = f"{d.name}_identifier.h"
    header = [files[name] for name in (*_IN_HEADER, own)]
    top = f"/* {d.library}.h and {d.library}.c: pvid in two files, with its licence in LICENSE.\n *\n * {d.banner} */\n"
    source = [top, f'#include "{d.library}.h"\n']
    parts = _parts(files)
    done = {*_IN_HEADER, own, *parts}
    commission = [_inlined(f"{d.name}_commission.h", files, done)] if d.excitation is not None else []
    wanted = [_FIRST] if _FIRST in files else []
    wanted += [one for name in (*sources(files), *parts) for one in includes_of(files[name])]
    source += [_inlined(name, files, done) for name in wanted]
    source += _units(files)
    public = {name for path in sources(files) for name in _PUBLIC.findall(_COMMENT.sub("", files[path]))}
    texts = {"pvid_reason_text", "pvid_status_text"}
    names = {name: f"{d.name}_{name}" for name in public - texts}
    header += [_renamed(one, names) for one in commission]
    return top + "".join(f"\n{_plain(one)}" for one in header), _renamed("\n".join(source), names)


def _inlined(name: str, files: Mapping[str, str], done: set[str]) -> str:
    """A header with those that it includes in their places, each once, as a compiler reads them."""
    if name in done:
        return ""
    done.add(name)
    return _OWN_INCLUDE.sub(lambda found: _inlined(found[1], files, done), files[name])


def _parts(files: Mapping[str, str]) -> list[str]:
    """Headers that are a part of one source, as their first comment says: their names are its own."""
    return [name for name, text in files.items() if name.endswith(".h") and _PART.search(text)]


def _with_parts(name: str, files: Mapping[str, str], done: set[str]) -> str:
    """A source with its parts in their places, each once."""
    parts = set(_parts(files))

    def text_of(found: re.Match[str]) -> str:
        if found[1] not in parts:
            return found[0]
        if found[1] in done:
            return ""
        done.add(found[1])
        return _with_parts(found[1], files, done)

    return _OWN_INCLUDE.sub(text_of, files[name])


def _plain(text: str) -> str:
    return _OWN_INCLUDE.sub("", text)


def _units(files: Mapping[str, str]) -> list[str]:
    """The sources; names of their own that others have too get the file's name behind them."""
    whole = {name: _with_parts(name, files, set()) for name in sources(files)}
    own_names = {name: _own_names(_COMMENT.sub("", text)) for name, text in whole.items()}
    often = Counter(one for names in own_names.values() for one in names)
    parts = []
    for name in sources(files):
        text, stem = _plain(whole[name]), re.sub(r"\W", "_", name.rpartition("/")[2].removesuffix(".c"))
        text = _renamed(text, {one: f"{one}_{stem}" for one in own_names[name] if often[one] > 1})
        if name.endswith("/text.c"):
            text = re.sub(r"^(const char \*pvid_\w+_text\()", r"PVID_WEAK_SYMBOL \1", text, flags=re.MULTILINE)
            text = _WEAK + text
        gone = "".join(f"#undef {one}\n" for one in dict.fromkeys(_MACRO.findall(text)))
        parts.append(f"/* ---- {name} ---- */\n{text}{gone}")
    return parts


def _own_names(text: str) -> set[str]:
    """Functions, tables and enumerators that a source without comments keeps to itself."""
    enumerators = (name for body in _ENUM.findall(text) for name in re.findall(r"(?:^|,)\s*(\w+)", body))
    return {*_STATIC.findall(text), *enumerators}


_WEAK = """\
#if defined(__GNUC__)
#define PVID_WEAK_SYMBOL __attribute__((weak))
#else
#define PVID_WEAK_SYMBOL
#endif
"""


def _renamed(text: str, names: Mapping[str, str]) -> str:
    """With other names, but not for fields of a struct."""
    if not names:
        return text
    pattern = re.compile(rf"(?<!\.)(?<!->)\b({'|'.join(sorted(map(re.escape, names)))})\b")
    return pattern.sub(lambda found: names[found[1]], text)


def package(d: Deployment) -> Files:
    """Name -> text."""
    header, source = amalgamated(d)
    example = {
        name: text.replace(f'#include "{d.name}_identifier.h"', f'#include "{d.library}.h"')
        for name, text in {**example_files(d), "main.c": main_of(d)}.items()
    }
    command = f"cc -O2 -I. {d.library}.c example/*.c -lm -o example/{d.name} && example/{d.name}"
    return (
        {f"{d.library}.h": header, f"{d.library}.c": source}
        | licence()
        | {f"example/{name}": text for name, text in example.items()}
        | {
            "README.md": readme(
                d,
                "in two files",
                [f"`{command}`.", f"In your own project: copy `{d.library}.h` and `{d.library}.c`."],
                [
                    "C99; C++ includes the header. Compile with -ffunction-sections and link with -Wl,--gc-sections: "
                    "what you do not call takes no flash.",
                    "Files of several mechanisms go into one program.",
                ],
            )
        }
    )
