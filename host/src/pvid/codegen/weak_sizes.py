"""Which PVID_MAX_ sizes of the core a model and a design of the weak identifier need."""

from __future__ import annotations

from collections.abc import Mapping

from pvid.base.errors import PvidError
from pvid.core.sizes import most_sizes
from pvid.model.compiled import CompiledModel
from pvid.settings.weak import NONE, WeakDesign32, WeakModel
from pvid.settings.weak_q31 import WeakDesignQ31

_MEANING = {
    "PVID_MAX_THETA": "coefficients",
    "PVID_MAX_P": "unknowns",
    "PVID_MAX_MOMENTS": "products of coefficients",
    "PVID_MAX_CONSTRAINTS": "constraints",
    "PVID_MAX_DRIFTS": "drifts",
    "PVID_MAX_THETA_Q31": "coefficients",
    "PVID_MAX_MOMENTS_Q31": "products of coefficients",
    "PVID_MAX_C_Q31": "derivatives of coefficients by unknowns",
    "PVID_MAX_SAMPLES": "signals",
    "PVID_MAX_INPUTS": "signals, derivatives and signs in its rows",
    "PVID_MAX_CHANNELS": "channels",
    "PVID_MAX_INTEGRANDS": "running integrals",
    "PVID_MAX_KINDS": "equations",
    "PVID_MAX_COLUMNS": "columns of an equation",
    "PVID_MAX_RING": "filtered samples",
    "PVID_MAX_HARMONICS": "harmonics of its test functions",
    "PVID_MAX_FUNCTIONS": "test functions",
    "PVID_MAX_POWER": "derivatives of its test functions",
    "PVID_MAX_DECIMATION": "samples a step",
}
_MOST_C = 255  # of the float core: pvid/detail/p_bits.h


def too_many_unknowns(name: str, unknowns: int) -> str | None:
    """Why the C core does not take a model of so many unknowns, whatever its rows are; None: it does."""
    most = most_sizes()["PVID_MAX_P"]
    if unknowns <= most:
        return None
    return (
        f"{name} has {unknowns} unknowns and the C core takes at most {most}: declare some of them as known; `pvid "
        "identify` in float64 takes all"
    )


def refuse_too_many_unknowns(model: CompiledModel) -> None:
    """PvidError for a model with more unknowns than the C core takes, and for a robot; at once, before its rows are
    looked at."""
    model.refuse_robot("the weak form in C")
    if (refusal := too_many_unknowns(model.name, len(model.unknowns))) is not None:
        raise PvidError(refusal)


def refuse_too_few_functions(name: str, thetas: int, unknowns: int) -> None:
    """PvidError for rows that cannot determine all unknowns, whatever the run is: the C core refuses them."""
    if thetas < unknowns:
        raise PvidError(
            f"the rows of {name} have {thetas} functions of its {unknowns} unknowns, too few for the C core: `pvid "
            "model check` names the unknowns of which one must be known, and the sensors that are missing"
        )


def _checked(name: str, sizes: Mapping[str, int]) -> dict[str, int]:
    """PvidError for what is larger than the core allows."""
    if (refusal := too_many_unknowns(name, sizes["PVID_MAX_P"])) is not None:
        raise PvidError(refusal)
    for macro, size in sizes.items():
        if size > (most := most_sizes().get(macro, size)):
            raise PvidError(f"{name} needs {size} {_MEANING.get(macro, macro)} and the C core takes at most {most}")
    return dict(sizes)


def sizes_of_model(model: WeakModel) -> dict[str, int]:
    """Macro -> least value. Raises PvidError where the model needs more than the core allows."""
    if (n_c := model.model.n_c) > _MOST_C:
        meaning = _MEANING["PVID_MAX_C_Q31"]
        raise PvidError(f"{model.name} needs {n_c} {meaning} and the C core takes at most {_MOST_C}")
    thetas = [one.thetas for one in model.kind]
    sizes = {
        "PVID_MAX_THETA": model.model.n_theta,
        "PVID_MAX_P": model.model.n_p,
        "PVID_MAX_MOMENTS": sum(n * (n + 1) // 2 for n in thetas),
        "PVID_MAX_SAMPLES": model.samples,
        "PVID_MAX_INPUTS": model.jets + model.runs + model.signs,
        "PVID_MAX_CHANNELS": max(sum(one.gain != NONE for one in model.channel), model.gains),
        "PVID_MAX_INTEGRANDS": max(model.integrands, model.runs, model.signs),
        "PVID_MAX_KINDS": model.kinds,
        "PVID_MAX_COLUMNS": max(one.columns for one in model.kind),
    }
    if model.model.constraints:
        sizes["PVID_MAX_CONSTRAINTS"] = model.model.constraints
    if model.model.drifts:
        sizes["PVID_MAX_DRIFTS"] = model.model.drifts
    return _checked(model.name, sizes)


def sizes_of_design(design: WeakDesign32) -> dict[str, int]:
    """Those of its model among them; raises as for that, and where the rows cannot determine all unknowns."""
    of_theta = design.model.model
    refuse_too_few_functions(design.model.name, of_theta.n_theta + of_theta.constraints, of_theta.n_p)
    sizes = sizes_of_model(design.model) | {
        "PVID_MAX_RING": design.model.signals * (4 * design.half_steps + 5),
        "PVID_MAX_HARMONICS": design.highest + 1,
        "PVID_MAX_FUNCTIONS": design.functions,
        "PVID_MAX_POWER": design.power,
        "PVID_MAX_DECIMATION": design.decimation,
        "PVID_MAX_BLOCKS": _blocks(_used_ticks(design.decimation), 8, design),
    }
    return _checked(design.model.name, sizes)


def _used_ticks(decimation: int) -> int:
    """Ticks of a step that neither add harmonics nor run stages."""
    return 0 if decimation == 1 else 2 if decimation >= 4 else 1


def _blocks(used: int, steps: int, design: WeakDesign32 | WeakDesignQ31) -> int:
    """Blocks of so many steps that the sums need: one where the other ticks of a step add and join all harmonics."""
    free, items = design.decimation - used, 2 * (design.highest + 1)
    return 1 if free * -(-items // (steps * free)) >= items else 2


def sizes_of_q31(design: WeakDesignQ31, n_p: int, n_c: int) -> dict[str, int]:
    """Those of a fixed-point design and its model with n_p parameters and n_c non-zeros of d theta / d p; raises as for
    a model in float32."""
    model = design.model
    thetas = [one.thetas for one in model.kind]
    refuse_too_few_functions("the model", sum(thetas), n_p)
    sizes = {
        "PVID_MAX_THETA_Q31": sum(thetas),
        "PVID_MAX_P": n_p,
        "PVID_MAX_MOMENTS_Q31": sum(n * (n + 1) // 2 for n in thetas),
        "PVID_MAX_C_Q31": n_c,
        "PVID_MAX_SAMPLES": model.samples,
        "PVID_MAX_INPUTS": len(model.jet) + model.runs + model.signs,
        "PVID_MAX_CHANNELS": max(sum(one.gain != NONE for one in model.channel), model.gains),
        "PVID_MAX_INTEGRANDS": max(model.integrands, model.runs, model.signs),
        "PVID_MAX_KINDS": len(model.kind),
        "PVID_MAX_COLUMNS": max(one.columns for one in model.kind),
        "PVID_MAX_RING": len(model.signal) * (4 * design.half + 5),
        "PVID_MAX_HARMONICS": design.highest + 1,
        "PVID_MAX_FUNCTIONS": design.functions,
        "PVID_MAX_POWER": design.power,
        "PVID_MAX_DECIMATION": design.decimation,
        "PVID_MAX_BLOCKS": _blocks(min(design.decimation - 1, 1), 4, design),
    }
    return _checked("the model in fixed point", sizes)
