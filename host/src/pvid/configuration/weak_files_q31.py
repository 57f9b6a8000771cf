"""The files of a mechanism's fixed-point weak form for a rig: model, tables and settings in C."""

from __future__ import annotations

from pvid.codegen import describe, files_weak_q31
from pvid.codegen.fitted_sizes import config_header, fitted_sizes_q31
from pvid.configuration.weak_q31 import FixedEngine
from pvid.setup.weak_sizes import sizes_of_q31


def files_of(engine: FixedEngine, command: str) -> dict[str, str]:
    """Name -> text.

    Parameters
    ----------
    command : that makes them; no date, so that the same command makes the same files
    """
    sizes = _sizes(engine)
    name = engine.name
    return {
        f"{name}_weak_q31.h": files_weak_q31.header(engine.made, sizes, command),
        f"{name}_weak_q31.c": files_weak_q31.source(engine.made, engine.parameters, command),
        f"{name}_design_q31.h": files_weak_q31.design_header(engine.config, name, sizes, command, about(engine)),
    }


def config_of(engine: FixedEngine, command: str) -> dict[str, str]:
    """The sizes of the core for this design alone: name -> text; parameters as of `files_of`."""
    name = f"{engine.name}_config_q31"
    return {f"{name}.h": config_header(name, fitted_of(engine), command)}


def fitted_of(engine: FixedEngine) -> dict[str, int]:
    """Sizes of the core for this design alone."""
    model = engine.parameters.model
    return fitted_sizes_q31(engine.config, model.n_p, len(model.c_row))


def _sizes(engine: FixedEngine) -> dict[str, int]:
    model = engine.parameters.model
    return sizes_of_q31(engine.config.design, model.n_p, len(model.c_row))


def about(engine: FixedEngine) -> list[str]:
    """The rig and the settings in words."""
    design, own = engine.config.design, engine.config.estimator
    compiled = engine.compiled
    units = {one.name: one.unit or "1" for one in compiled.signals}
    readings = [
        (f"reading[{k}]", name, f"{lsb:.6g} {units[name]} a count,", f"within +-{full} of its offset")
        for k, (name, lsb, full) in enumerate(zip(engine.sample_names, engine.lsb, design.full_scale, strict=True))
    ]
    parameters = [
        (
            f"{one.name} [{one.unit or '1'}]",
            f"= integer 2^{-bits},",
            f"start {engine.values(own.start)[k]:.6g},",
            f"{engine.values(own.lower)[k]:.6g} to {engine.values(own.upper)[k]:.6g}",
        )
        for k, (one, bits) in enumerate(zip(compiled.unknowns, own.p_bits, strict=True))
    ]
    first = f"at most {engine.ticks_needed} samples, {engine.ticks_needed / engine.sample_rate:.3g} s"
    return [
        f"{compiled.title}: {design.functions} test functions sin^{design.power} on windows of "
        f"{2 * engine.hop_s:.6g} s, one every {engine.hop_s:.6g} s;",
        f"{engine.sample_rate:.6g} samples a second, {design.decimation} make a step. The first estimate comes after "
        f"{first}.",
        "",
        "Readings [counts]:",
        *describe.table(readings),
        "",
        "Parameters:",
        *describe.table(parameters),
    ]
