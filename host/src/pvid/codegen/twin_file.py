"""NAME_twin.py: a model's generated functions in numpy, printed from their C with what these call of the core."""

from __future__ import annotations

from pvid.base.recent import Recent
from pvid.codegen import files_functions
from pvid.codegen.c_text import banner
from pvid.codegen.generated import GeneratedModel
from pvid.core.sources import PUBLIC_FOLDERS, SRC, source
from pvid.twin.printer.program import text_of

_CORE = ("elementary_f32", "elementary_q31", "integer_q31", "scaled_q31")


def printed(model: GeneratedModel) -> dict[str, str]:
    """NAME_twin.py."""
    return {f"{model.name}_twin.py": text(model)}


@Recent
def text(model: GeneratedModel) -> str:
    """The module: NAME_FUNCTION_f32(in, out) and, where there is fixed point, NAME_FUNCTION_q31(in, out)."""
    functions, name = model.functions, model.name
    texts = files_functions.printed_f32(model) | files_functions.printed_q31(model)
    cores = ["f32", *(["q31"] if f"{name}_q31.c" in texts else [])]
    roots = [f"{name}_{one.name}_{core}" for core in cores for one in functions.functions]
    sources = [source(f"{one}.c") for one in _CORE]
    about = [f"{model.compiled.title}: its functions, printed from their C.", "", *banner(functions, model.command)]
    return text_of(sources, [*PUBLIC_FOLDERS, SRC], {}, roots, texts, about="\n".join([*about, ""]))
