"""Was an input computed from the measured outputs? Then the rows may describe the controller in place of the mechanism.

That an input is a function of the outputs proves nothing: a constant or slow input is one, and so is the input of a
mechanism that is fast beside its drive (V = R i + k w). Two facts do. A controller computes its input from the outputs
as measured: the input follows their noise, while what drives a mechanism lies off any law of its outputs by at least
the noise that this law takes from them. Or the input contains nothing of what the mechanism's own terms need, as where
a hand moves an arm whose drive compensates gravity: the terms that the law lacks, such as an inertia, then have no
value.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import sympy as sp

from pvid.model.compiled import CompiledModel, Signal
from pvid.model.signals import Jet
from pvid.oracle.weak.front import filtered, segments_of
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.solve import Fit
from pvid.oracle.weak.verdict import Reason

# An input is a law of the outputs if this leaves less than this part of its variance ...
_LAW = 0.02
# ... and either less than this part of the variance that the outputs' noise has in the law,
_OF_NOISE = 0.25
# or less than this part of the energy that the terms beyond the law have at the model's guesses, and less than so many
# times what the model leaves.
_OF_TERMS = 0.01
_NO_BETTER = 3.0

_LEVELS = 16  # an input of so few values is set by a program
_LAGS = 4  # samples of each output in a law: a derivative by differences, a delay


def of_feedback(model: CompiledModel, run: Mapping[str, npt.ArrayLike], fit: Fit, determined: bool) -> list[Reason]:
    """Inputs that a controller computed from the outputs alone.

    Parameters
    ----------
    run : name of each signal -> samples [n]
    determined : every parameter has a value, within its range
    """
    out = []
    samples = {one.name: np.asarray(run[one.name], np.float64) for one in model.signals}
    longest = max(segments_of(samples), key=lambda one: one.stop - one.start)
    samples = {name: x[longest] for name, x in samples.items()}
    outputs = [one for one in model.signals if one.kind == "sensor" and not one.driven]
    for one in model.signals:
        if one.kind != "input" or len(np.unique(samples[one.name])) <= _LEVELS:
            continue
        left = _follows_noise(samples, one.name, outputs)
        if left is None and not determined:
            left = _moves_nothing(model, fit, one, outputs)
        if left is not None:
            text = (
                f"{one.name} is a function of the measured outputs ({100 * (1 - left):.4g} % of its variance): the "
                "estimate may describe the controller, not the mechanism. Add an excitation that does not depend on "
                "the outputs."
            )
            out.append(Reason("feedback", text))
    return out


def _follows_noise(samples: Mapping[str, Float], name: str, outputs: list[Signal]) -> float | None:
    """Part of an input's variance that a law of the outputs' last samples and running sums leaves, if that is less than
    their noise allows; else None."""
    u = samples[name][_LAGS - 1 :]
    count = len(u)
    columns, noisy = [np.ones(count), np.linspace(-1.0, 1.0, count)], []
    for one in outputs:
        x = samples[one.name]
        lagged = [x[_LAGS - 1 - lag : _LAGS - 1 - lag + count] for lag in range(_LAGS)]
        slopes: list[Float] = [np.ones(count)] * _LAGS
        columns += [*lagged, np.cumsum(lagged[0] - np.mean(lagged[0]))]
        places = [*range(len(columns) - _LAGS - 1, len(columns) - 1)]
        if one.unit == "rad":
            columns += [np.sin(lagged[0]), np.cos(lagged[0])]
            places += [len(columns) - 2, len(columns) - 1]
            slopes = [*slopes, np.cos(lagged[0]), -np.sin(lagged[0])]
        noisy.append((_noise_of(x, one.sd), places, slopes))
    basis = np.stack([x - np.mean(x) if k else x for k, x in enumerate(columns)], axis=1)
    size = np.maximum(np.linalg.norm(basis, axis=0), 1e-300)
    law = np.linalg.lstsq(basis / size, u, rcond=1e-12)[0] / size
    left, total = float(np.mean((u - basis @ law) ** 2)), float(np.var(u))
    allowed = 0.0
    for sd, places, slopes in noisy:
        now = law[places[0]] * slopes[0]
        for place, slope in zip(places[_LAGS:], slopes[_LAGS:], strict=True):
            now = now + law[place] * slope
        allowed += sd**2 * float(np.mean(now**2) + np.sum(law[places[1:_LAGS]] ** 2))
    return left / total if left < _LAW * total and left < _OF_NOISE * allowed else None


def _noise_of(x: Float, sd: float) -> float:
    """Standard deviation of the white noise of a signal: as declared, or what its third differences contain."""
    return float(min(sd, np.median(np.abs(np.diff(x, 3))) / (0.6745 * np.sqrt(20.0))))


def _moves_nothing(model: CompiledModel, fit: Fit, given: Signal, outputs: list[Signal]) -> float | None:
    """Part of an input's variance that a law of the outputs leaves, if it contains nothing of the model's other terms
    and the model explains no more; else None.

    Of an output the law has derivatives below the highest one of the equations: all of them are the mechanism itself.
    """
    rows, functions = fit.rows, fit.rows.functions
    grid = rows.record.grid
    chi = functions.combine(0)

    def sums(x: Float) -> Float:
        return np.asarray((functions.window_sums(x) @ chi)[rows.numbers].reshape(-1))

    law = [np.ones(grid.size)]
    for one in outputs:
        order = _order_of(model, one.name)
        if order < 1:
            continue
        z = filtered(np.nan_to_num(grid.raw[one.name]), grid.design.weights(0))[grid.places]
        law.append(z)
        if order > 1 and (grid.design.rate_taps > 1 or grid.design.taps > 1):
            law.append(filtered(np.nan_to_num(grid.raw[one.name]), grid.design.weights(1))[grid.places])
        if one.unit == "rad":
            law += [np.sin(z), np.cos(z)]
    basis = np.stack([sums(x) for x in law], axis=1)
    basis = np.linalg.qr(basis / np.maximum(np.linalg.norm(basis, axis=0), 1e-300))[0]

    def rest(x: Float) -> float:
        return float(np.sum((x - basis @ (basis.T @ x)) ** 2))

    u = sums(grid.raw[given.name][grid.places])
    constant = sums(np.ones(grid.size))
    total = float(np.sum((u - constant * (constant @ u) / (constant @ constant)) ** 2))
    guess = fit.parameters.checked(None)
    at_guess, found = fit.parameters.theta(guess), fit.parameters.theta(fit.p)
    for kind, row in enumerate(model.rows):
        gain = sp.diff(sp.sympify(row.known.get(0, 0)), given.jet)
        gain = model.with_knowns(gain) if gain != 0 else gain
        if gain == 0 or not gain.is_number:
            continue
        columns = rows.columns[kind]
        thetas = len(found[kind])
        terms = np.einsum("wjk,j->wk", columns[:, :thetas], at_guess[kind]).reshape(-1)
        noise = rows.windows * rows.noise.size(kind, at_guess[kind])
        missing = (rest(terms) - noise) / float(gain) ** 2
        model_left = float(np.sum((columns[:, thetas] - np.einsum("wjk,j->wk", columns[:, :thetas], found[kind])) ** 2))
        left = rest(u)
        if left < min(_LAW * total, _OF_TERMS * missing, _NO_BETTER * model_left / float(gain) ** 2):
            return left / total
    return None


def _order_of(model: CompiledModel, name: str) -> int:
    """Highest derivative of a signal in the rows."""
    orders = [0]
    for row in model.rows:
        for part in (*row.regressors, row.known):
            for order, psi in part.items():
                for jet in sp.sympify(psi).atoms(Jet):
                    below = model.opaque.get(Jet(jet.of), Jet(jet.of)).atoms(Jet)
                    orders += [order + jet.order + one.order for one in below if one.of == name]
    return max(orders)
