#!/usr/bin/env python3
"""Runs the notebooks of host/notebooks, cell by cell in one process, as a kernel would.

    tools/notebooks.py             runs them in a temporary folder; exits 1 at the first cell that fails
    tools/notebooks.py --update    and stores what the cells print and show

Jupyter itself is not needed: a cell's output is what it prints, and the value of its last expression, as a picture,
HTML or text, in this order.
"""

import argparse
import ast
import base64
import contextlib
import io
import json
import os
import sys
import tempfile
import traceback
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[1] / "host" / "notebooks"


def run_cell(source: str, names: dict[str, Any]) -> list[dict[str, Any]]:
    """Its outputs, in the notebook's format; an exception goes through."""
    body = ast.parse(source)
    last = body.body.pop() if body.body and isinstance(body.body[-1], ast.Expr) else None
    value = None
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        exec(compile(body, "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    outputs: list[dict[str, Any]] = []
    if printed.getvalue():
        outputs.append({"name": "stdout", "output_type": "stream", "text": _lines(printed.getvalue())})
    if value is not None:
        outputs.append({"data": shown(value), "metadata": {}, "output_type": "display_data"})
    return outputs


def shown(value: Any) -> dict[str, Any]:
    """A value as Jupyter would show it."""
    data: dict[str, Any] = {"text/plain": _lines(repr(value))}
    if hasattr(value, "_repr_html_"):
        data["text/html"] = _lines(value._repr_html_())
    if hasattr(value, "_repr_png_"):
        data["image/png"] = base64.b64encode(value._repr_png_()).decode()
    return data


def _lines(text: str) -> list[str]:
    return text.splitlines(keepends=True)


def run_notebook(path: Path) -> dict[str, Any]:
    """The notebook with the outputs of its cells, which run in the present folder."""
    notebook: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    names: dict[str, Any] = {"__name__": "__main__"}
    number = 0
    for cell in notebook["cells"]:
        if cell["cell_type"] != "code":
            continue
        number += 1
        cell["outputs"] = run_cell("".join(cell["source"]), names)
        cell["execution_count"] = number
    return notebook


def text_of(notebook: dict[str, Any]) -> str:
    """The text of its file."""
    return json.dumps(notebook, indent=1, ensure_ascii=False) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description="Runs the notebooks of host/notebooks.")
    parser.add_argument("--update", action="store_true", help="store the outputs")
    update = parser.parse_args().update
    for path in sorted(FOLDER.glob("*.ipynb")):
        with tempfile.TemporaryDirectory() as folder:
            os.chdir(folder)
            try:
                notebook = run_notebook(path)
            except Exception:  # of a cell: anything
                traceback.print_exc()
                print(f"{path.name}: a cell failed", file=sys.stderr)
                return 1
            finally:
                os.chdir(FOLDER)
        if update:
            path.write_text(text_of(notebook), encoding="utf-8")
        print(f"{path.name}: ran")
    return 0


if __name__ == "__main__":
    sys.exit(main())
