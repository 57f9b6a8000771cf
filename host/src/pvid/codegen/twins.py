"""The numpy twins of a model's generated C: the one door to the modules that print them."""

from __future__ import annotations

from pvid.codegen import refine_twin, twin_file
from pvid.codegen.generated import GeneratedModel


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_twin.py, and NAME_refine_twin.py where there is a second stage."""
    files = {f"{model.name}_twin.py": twin_file.text(model.functions, model.command, model.fixed.made)}
    if model.refinement.made is not None:
        files[f"{model.name}_refine_twin.py"] = refine_twin.text(model.refinement.made, model.command)
    return files
