#!/usr/bin/env python3
"""Prints the refinement's functions of the pendulum, with which a core is built that is given no others.

--check: only compares.

Run it with build/venv/bin/python after a change of the pendulum's description or of the printers.
"""

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "host" / "src"))
from pvid.codegen.files_refine import header, shape  # noqa: E402
from pvid.codegen.refine import refine_functions  # noqa: E402
from pvid.models.mechanisms import compiled_of  # noqa: E402

NAME = "kapitza"
FOLDER = ROOT / "firmware" / "examples" / "refine_model"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--check", action="store_true")
    check = parser.parse_args().check
    made, command = refine_functions(compiled_of(NAME)), f"pvid model build {NAME}"
    for path, text in (
        (FOLDER / "refine_model_f32.h", header(made, command)),
        (FOLDER / "pvid" / "refine_shape.h", shape(made, command)),
    ):
        if not check:
            path.write_text(text, encoding="utf-8")
        elif not path.is_file() or path.read_text(encoding="utf-8") != text:
            sys.exit(f"{path.relative_to(ROOT)} is not what the description generates: run tools/print_refine.py")


if __name__ == "__main__":
    main()
