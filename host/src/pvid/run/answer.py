"""The answer of `pvid identify`: its JSON object, and what a person reads."""

from __future__ import annotations

from typing import Any

from rich.markup import escape
from rich.table import Table

from pvid.base.rounding import percent, with_error
from pvid.run.identify import LINEAR, PHYSICAL, UNITS, ZERO, Identification

NAMES = (*PHYSICAL, *LINEAR, ZERO)


def as_json(result: Identification) -> dict[str, Any]:
    """The object of `identify --json` (host/docs/index.md): null where nothing is identified or judged."""
    parameters = {name: _parameter(result, name) for name in NAMES}
    beyond = result.beyond
    return {
        "identified": result.identified,
        "status": result.status,
        "warning": result.warning,
        "advice": list(result.advice),
        "parameters": parameters,
        **parameters,
        "chi2": result.chi2,
        "unexplained": result.unexplained,
        "kappa": result.kappa,
        "largest_angle": result.largest_angle,
        "modes_hz": list(result.modes_hz) or None,
        "first_publication_s": result.first_publication_s,
        "trusted_s": result.trusted_s,
        "reasons": dict(result.reasons),
        "samples_beyond_range": None
        if beyond is None
        else {"phi": beyond.phi, "y": beyond.y, "acceleration": beyond.acceleration},
        "input": list(result.notes),
        "ticks": result.ticks,
        "updates": result.updates,
        "lost": result.lost,
        "hash": None if result.hash is None else f"{result.hash:08x}",
        "core": result.core,
        "form": result.form,
        "law": result.law,
        "on": result.on,
    }


def _parameter(result: Identification, name: str) -> dict[str, Any]:
    """Value, standard error and what this is made of; nulls for what is not identified."""
    known = result.identified and name in result.value
    parts = result.parts.get(name) if known else None
    return {
        "value": result.value[name] if known else None,
        "se": result.se[name] if known else None,
        "unit": UNITS[name],
        "se_noise": parts.noise if parts else None,
        "se_y_gain": parts.y_gain if parts else None,
        "se_l1": parts.l1 if parts else None,
    }


def label(name: str) -> str:
    """A parameter with its unit."""
    return f"{name} [{UNITS[name]}]" if UNITS[name] else name


def table(result: Identification, truths: dict[str, float] | None = None) -> Table | None:
    """The parameters, rounded to their errors; None where nothing is identified: a guess is no estimate."""
    if not result.identified:
        return None
    out = Table(title=f"{result.form} form, {result.law} law, core {result.core} on {result.on}")
    out.add_column("parameter")
    if truths:
        out.add_column("truth", justify="right")
    out.add_column("estimate", justify="right")
    out.add_column("standard error", justify="right")
    if truths:
        out.add_column("error %", justify="right")
    for name in NAMES:
        if name not in result.value:
            continue
        cells = [*with_error(result.value[name], result.se[name])]
        if truths:
            cells.insert(0, f"{truths[name]:.6g}")
            cells.append(f"{100 * (result.value[name] / truths[name] - 1):+.4f}" if truths[name] else "")
        out.add_row(escape(label(name)), *cells)
    return out


def one_line(result: Identification) -> str:
    """The parameters, or why there are none, in a line."""
    if not result.identified:
        return f"nothing: {result.verdict}"
    pairs = [(name, with_error(result.value[name], result.se[name])) for name in result.value]
    return ", ".join(f"{name} {value} +- {error}" for name, (value, error) in pairs)


def status_line(result: Identification) -> str:
    """What the core reported besides the parameters."""
    chi2 = "" if result.chi2 is None else f" chi2 {result.chi2:.2g};"
    since = f" since the estimate of {result.trusted_s:.1f} s" if result.is_old else ""
    return (
        f"status {result.status}{since};{chi2} kappa {result.kappa:.2g}; {result.ticks} ticks, "
        f"{result.updates} updates, {result.lost} lost; hash {'none' if result.hash is None else f'{result.hash:08x}'}"
    )


def error_line(result: Identification, y_gain_sd: float, l1_sd: float) -> str | None:
    """What the standard errors of g, l2, rho2 are made of; None where nothing is identified.

    Parameters
    ----------
    y_gain_sd, l1_sd
        The rig file's, relative.
    """
    if not result.identified:
        return None
    names = [name for name in PHYSICAL if name in result.value] or list(LINEAR)

    def of_each(part: str) -> str:
        sizes = [(name, abs(getattr(result.parts[name], part) / result.value[name])) for name in names]
        return ", ".join(f"{name} {percent(size)}" for name, size in sizes if size > 1e-12)

    noise = f"standard errors: from the run's noise {of_each('noise')}"
    if y_gain_sd == 0.0 and l1_sd == 0.0:
        return f"{noise}; the gain of y and l1 count as exact (y_gain_sd and l1_sd are 0 in the rig file)"
    return (
        f"{noise}; from the gain of y, known to {percent(y_gain_sd)} (y_gain_sd), {of_each('y_gain') or 'none'}; "
        f"from l1, known to {percent(l1_sd)} (l1_sd), {of_each('l1') or 'none'}"
    )
