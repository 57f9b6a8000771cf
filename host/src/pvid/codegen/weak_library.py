"""The weak form of a mechanism in C, on this computer: generated, compiled, loaded."""

from __future__ import annotations

from pvid.codegen import files_refine, files_weak, files_weak_q31
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.refine import RefineFunctions
from pvid.codegen.weak_q31 import FixedWeak, ParametersQ31
from pvid.codegen.weak_sizes import sizes_of_design, sizes_of_model, sizes_of_q31
from pvid.core.model_library import ModelSources
from pvid.core.sizes import roomy
from pvid.core.weak_native import WeakNative
from pvid.core.weak_native_q31 import WeakNativeQ31
from pvid.model.compiled import CompiledModel
from pvid.settings.cores import FIXED
from pvid.settings.weak import WeakDesign32
from pvid.settings.weak_q31 import WeakConfigQ31

_MADE_BY = "identification"


def weak_sources(
    compiled: CompiledModel, design: WeakDesign32 | None = None, refine: RefineFunctions | None = None
) -> ModelSources:
    """C of a model, with arrays that hold a design; `refine`: with the second stage.

    Raises PvidError when the identifier does not have what the model needs.
    """
    model = GeneratedModel(compiled, _MADE_BY)
    name = model.weak.needed.name
    needed = sizes_of_model(model.weak_model) if design is None else sizes_of_design(design)
    texts = files_weak.printed(model)
    if refine is not None:
        texts |= files_refine.files_of(refine, _MADE_BY)
    return ModelSources(name, texts, roomy(needed))


def weak_native(
    compiled: CompiledModel, design: WeakDesign32 | None = None, refine: RefineFunctions | None = None
) -> WeakNative:
    """The library of a model: as `weak_sources`; PvidError as well when there is no compiler."""
    sources = weak_sources(compiled, design, refine)
    return WeakNative(sources.name, sources.library(), sources)


def weak_sources_q31(made: FixedWeak, parameters: ParametersQ31, config: WeakConfigQ31) -> ModelSources:
    """C of a model in fixed point, a design and its settings."""
    name = made.functions.name
    needed = sizes_of_q31(config.design, parameters.model.n_p, len(parameters.model.c_row))
    texts = {
        f"{name}_weak_q31.h": files_weak_q31.header(made, needed, _MADE_BY),
        f"{name}_weak_q31.c": files_weak_q31.source(made, parameters, _MADE_BY),
        f"{name}_design_q31.h": files_weak_q31.design_header(config, name, needed, _MADE_BY, []),
        "configuration.c": f'#include "{name}_design_q31.h"\n#include "configuration.h"\n\n'
        f"const pvid_weak_config_q31 *{name}_settings_q31 = &{name}_config_q31;\n",
        "configuration.h": f'#include "pvid/weak_q31.h"\nextern const pvid_weak_config_q31 *{name}_settings_q31;\n',
    }
    return ModelSources(name, texts, roomy(needed), FIXED, ("configuration.h",))


def weak_native_q31(made: FixedWeak, parameters: ParametersQ31, config: WeakConfigQ31) -> WeakNativeQ31:
    """The library of a model in fixed point, a design and its settings; PvidError when there is no compiler."""
    sources = weak_sources_q31(made, parameters, config)
    return WeakNativeQ31(sources.name, sources.library(), config, sources)
