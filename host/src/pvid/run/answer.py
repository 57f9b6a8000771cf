"""Output of `pvid identify`: JSON object, table and lines."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from rich.markup import escape
from rich.table import Table

from pvid.base.rounding import percent, with_error
from pvid.models.model import Quantity, Scale
from pvid.oracle.weak.words import of_warning
from pvid.rig.file import RigFile
from pvid.run.identify import Identification


def as_json(result: Identification) -> dict[str, Any]:
    """The object of `identify --json` (host/docs/index.md); null: not identified, or not judged."""
    parameters = {one.name: _parameter(result, one) for one in result.model.answers}
    beyond = result.beyond
    return {
        "identified": result.identified,
        "verdict": of_warning(result.identified, result.warning),
        "status": result.status,
        "warning": result.warning,
        "advice": list(result.advice),
        "parameters": parameters,
        **parameters,
        "chi2": result.chi2,
        "kappa": result.kappa,
        "largest_angle": result.largest_angle,
        "modes_hz": list(result.modes_hz) or None,
        "first_publication_s": result.first_publication_s,
        "trusted_s": result.trusted_s,
        "reasons": dict(result.reasons),
        "samples_beyond_range": None if beyond is None else {"phi": beyond.phi, "y": beyond.y},
        "input": list(result.notes),
        "ticks": result.ticks,
        "updates": result.updates,
        "lost": result.lost,
        "hash": None if result.hash is None else f"{result.hash:08x}",
        "core": result.core,
        "form": result.form,
        "law": result.law,
        "on": result.on,
        **({} if result.refinement is None else {"refinement": result.refinement.as_json()}),
    }


def _parameter(result: Identification, of: Quantity) -> dict[str, Any]:
    """Value, standard error and its parts; null if the parameter is not identified."""
    name, known = of.name, result.identified and of.name in result.value
    parts = result.parts.get(name) if known else None
    return {
        "value": result.value[name] if known else None,
        "se": result.se[name] if known else None,
        "unit": of.unit,
        "verdict": of_warning(known, result.warning),
        "se_noise": parts.noise if parts else None,
        **{f"se_{one.name}": parts.scales[one.name] if parts else None for one in result.model.scales},
    }


def table(result: Identification, truths: dict[str, float] | None = None) -> Table | None:
    """The parameters, rounded to their errors; None if the run is not identified."""
    if not result.identified:
        return None
    out = Table(title=f"{result.method} on {result.on}")
    out.add_column("parameter")
    if truths:
        out.add_column("truth", justify="right")
    out.add_column("estimate", justify="right")
    out.add_column("standard error", justify="right")
    if truths:
        out.add_column("error %", justify="right")
    for one in result.model.answers:
        name = one.name
        if name not in result.value:
            continue
        cells = [*with_error(result.value[name], result.se[name])]
        if truths:
            cells.insert(0, f"{truths[name]:.6g}")
            cells.append(f"{100 * (result.value[name] / truths[name] - 1):+.4f}" if truths[name] else "")
        out.add_row(escape(one.name_and_unit), *cells)
    return out


def one_line(result: Identification) -> str:
    """The parameters in one line, or the reason why there are none."""
    if not result.identified:
        return f"nothing: {result.verdict}"
    pairs = [(name, with_error(result.value[name], result.se[name])) for name in result.value]
    return ", ".join(f"{name} {value} +- {error}" for name, (value, error) in pairs)


def status_line(result: Identification) -> str:
    """The core's report without the parameters."""
    chi2 = "" if result.chi2 is None else f" chi2 {result.chi2:.2g};"
    since = f" since the estimate of {result.trusted_s:.1f} s" if result.is_old else ""
    return (
        f"status {result.status}{since};{chi2} kappa {result.kappa:.2g}; {result.ticks} ticks, "
        f"{result.updates} updates, {result.lost} lost; hash {'none' if result.hash is None else f'{result.hash:08x}'}"
    )


def refinement_line(result: Identification) -> str | None:
    """What became of the refinement, with what it found beside the parameters; None where none was asked for."""
    found = result.refinement
    if found is None:
        return None
    extras = {} if found.outcome is None or not found.adopted else found.outcome.extras
    shown = [f"{name} {value:.3g} +- {se:.1g}" for name, (value, se) in extras.items() if 0 < se < math.inf]
    return "; ".join([found.text, *([", ".join(shown)] if shown else [])])


def error_line(result: Identification, rig: RigFile) -> str | None:
    """Parts of the standard errors of the physical parameters; None if the run is not identified."""
    if not result.identified:
        return None
    model, scale_sd = result.model, rig.scale_sd
    names = [name for name in model.physical_names if name in result.value] or list(model.mapped_names)

    def of_each(part: Mapping[str, float]) -> str:
        sizes = [(name, abs(part[name] / result.value[name])) for name in names]
        return ", ".join(f"{name} {percent(size)}" for name, size in sizes if size > 1e-12)

    noise = f"standard errors: from the run's noise {of_each({name: result.parts[name].noise for name in names})}"
    if not any(scale_sd.values()):
        scales, keys = " and ".join(one.meaning for one in model.scales), " and ".join(map(_key, model.scales))
        return f"{noise}; {scales} count as exact ({keys} are 0 in the rig file)" if model.scales else noise
    parts = [noise]
    for one in model.scales:
        of = of_each({name: result.parts[name].scales[one.name] for name in names})
        parts.append(f"from {one.meaning}, known to {percent(scale_sd[one.name])} ({_key(one)}), {of or 'none'}")
    return "; ".join(parts)


def _key(scale: Scale) -> str:
    """Its key of the rig file without the table."""
    return scale.sd_key.rpartition(".")[2]
