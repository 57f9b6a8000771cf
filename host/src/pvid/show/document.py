"""A page in one file, with nothing from elsewhere: for a screen, a telephone, a dark room and paper."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterable, Sequence
from html import escape
from typing import Any

from matplotlib import rc_context
from matplotlib.figure import Figure

from pvid.base.replacing import CREATOR
from pvid.base.wording import in_utf8, printable
from pvid.show import answer_figure as of

STYLE = """
:root { color-scheme: light dark; --ink: #20242a; --quiet: #5f6b78; --line: #d5dae0; --paper: #fff; --raised: #f4f6f8;
  --measured: #9aa5b1; --predicted: #d9480f; --value: #1c66b3; --good: #1b7f3b; --usable: #9a6700; --bad: #c92a2a; }
@media screen and (prefers-color-scheme: dark) { :root { --ink: #e6e9ed; --quiet: #9aa5b1; --line: #3a424c;
  --paper: #15181c; --raised: #1f242a; --measured: #6b7785; --predicted: #ff8c4b; --value: #6cb2ff; --good: #4cc274;
  --usable: #e3b341; --bad: #ff7b72; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--paper); color: var(--ink); font: 16px/1.5 system-ui, sans-serif; }
main { max-width: 50rem; margin: 0 auto; padding: 2rem 1.25rem 4rem; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .3rem; } h2 { font-size: 1.2rem; margin: 2.4rem 0 .6rem; }
p { margin: .5rem 0; } .quiet { color: var(--quiet); } h1, h2, p, li, td { overflow-wrap: break-word; }
.wide { overflow-x: auto; } table { border-collapse: collapse; margin: .8rem 0; font-variant-numeric: tabular-nums; }
td, th { padding: .3rem 1.1rem .3rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); }
th { font-weight: 600; color: var(--quiet); font-size: .85rem; } td.number { white-space: nowrap; }
.badge { display: inline-block; border: 2px solid; border-radius: .4rem; padding: 0 .6rem; font-weight: 700; }
.good { color: var(--good); } .usable { color: var(--usable); } .bad { color: var(--bad); }
figure { margin: 1rem 0; overflow-x: auto; } figure svg { min-width: 30rem; width: 100%; height: auto; display: block; }
figcaption { color: var(--quiet); font-size: .9rem; }
code, pre { font: .85rem/1.45 ui-monospace, monospace; background: var(--raised); border-radius: .3rem; }
code { padding: .1rem .3rem; } pre { padding: .7rem; white-space: pre-wrap; overflow-wrap: anywhere; margin: .4rem 0; }
li { margin: .4rem 0; } ul { padding-left: 1.2rem; }
.bar { display: flex; width: 9rem; height: .8rem; margin-top: .4rem; background: var(--line); }
.bar > * { display: block; height: 100%; print-color-adjust: exact; -webkit-print-color-adjust: exact; }
.broad { max-width: 84rem; } .broad p { max-width: 50rem; }
.key { display: inline-block; font-weight: 600; margin-right: 1.2rem; }
.multiples { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(19rem, 100%), 1fr)); gap: 0 1rem; }
.multiples figure { margin: .3rem 0; } .multiples svg { min-width: 0; }
@media (max-width: 32rem) { main { padding: 1rem .8rem 3rem; } td, th { padding-right: .7rem; }
  td.number { white-space: normal; } .bar { width: 4.5rem; } .cards th { display: none; }
  .cards, .cards tbody { display: block; }
  .cards td { display: block; border: 0; padding: .1rem 0; } .cards tr { display: block; padding: .4rem 0;
    border-bottom: 1px solid var(--line); } .cards td::before { content: attr(data-head) " "; color: var(--quiet); }
  .cards td:empty { display: none; } }
@media print, (max-width: 70rem) { .cards td.number { white-space: normal; } .cards td { padding-right: .5rem; } }
@page { margin: 16mm; }
@media print { :root { color-scheme: light; } body { font-size: 10.5pt; }
  main { max-width: none; padding: 0; } figure, tr, li, pre { break-inside: avoid; }
  h2 { break-after: avoid; margin-top: 1.4rem; } .wide, figure { overflow: visible; }
  figure svg { min-width: 0; } }
"""
_COLORS = {of.INK: "ink", of.QUIET: "quiet", of.MEASURED: "measured", of.PREDICTED: "predicted", of.VALUE: "value"}
_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def text(of_anybody: object) -> str:
    """A text from anywhere, as it may stand in a page."""
    return escape(in_utf8(printable(str(of_anybody))))


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: int = 0, cards: bool = False) -> str:
    """Of cells in HTML; the last `numbers` of each row do not wrap; cards: on a telephone each row is a list."""
    first = f"<tr>{''.join(f'<th>{one}</th>' for one in heads)}</tr>" if heads else ""

    def cell(k: int, of: int, content: str) -> str:
        head = f' data-head="{heads[k]}"' if cards else ""
        return f"<td{' class=number' if k >= of - numbers else ''}{head}>{content}</td>"

    lines = ["".join(cell(k, len(row), content) for k, content in enumerate(row)) for row in rows]
    kind = ' class="cards"' if cards else ""
    return f'<div class="wide"><table{kind}>{first}{"".join(f"<tr>{one}</tr>" for one in lines)}</table></div>'


def picture(draw: Callable[[Figure], None], height: float, caption: str, name: str, width: float = of.WIDTH) -> str:
    """A figure of that size [inches] with a caption in HTML; its colours follow those of the page.

    Parameters
    ----------
    name : different from that of other pictures of the page
    """
    settings: Any = {"svg.fonttype": "none", "svg.hashsalt": name, "text.parse_math": False, "font.size": 10}
    settings |= dict.fromkeys(("text.color", "axes.labelcolor", "xtick.color", "ytick.color"), of.INK)
    settings |= {"axes.edgecolor": of.QUIET, "axes.facecolor": "none", "legend.frameon": False}
    drawn = io.StringIO()
    with rc_context(settings):
        figure = Figure(figsize=(width, height), layout="constrained")
        figure.patch.set_alpha(0.0)
        draw(figure)
        figure.savefig(drawn, format="svg", metadata={"Date": None, "Creator": None})
    svg = drawn.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r'\b(id="|url\(#|href="#)', rf"\g<1>{name}-", svg)
    for color, variable in _COLORS.items():
        svg = svg.replace(color, f"var(--{variable})")
    svg = re.sub(r"font: ([\d.]+px) [^;\"]*", r"font: \1 system-ui, sans-serif", svg)
    below = f"<figcaption>{caption}</figcaption>" if caption else ""
    label = escape(re.sub("<.*?>", "", caption))
    return f'<figure role="img" aria-label="{label}">{svg}{below}</figure>'


def document(title: str, body: str, *, refresh: int = 0, broad: bool = False) -> str:
    """The whole page.

    Parameters
    ----------
    title : text, of anybody
    body : in HTML
    refresh : seconds after which a browser loads it again; 0: never
    broad : it has columns for a wide screen
    """
    kind = ' class="broad"' if broad else ""
    again = f'<meta http-equiv="refresh" content="{refresh}">' if refresh else ""
    head = (
        f'<meta charset="utf-8"><meta name="generator" content="{CREATOR}">'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta name="color-scheme" content="light dark">{again}<title>{text(title)}</title><style>{STYLE}</style>'
    )
    return f'<!doctype html>\n<html lang="en"><head>{head}</head><body><main{kind}>{body}</main></body></html>\n'
