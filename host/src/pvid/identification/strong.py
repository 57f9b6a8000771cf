"""Identification of a described mechanism by its strong form: the C core in float32 or the analysis in float64."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pvid.base.wording import listed
from pvid.codegen.strong_library import strong_native
from pvid.codegen.strong_library_q31 import StrongNativeQ31
from pvid.configuration.shared import CLASH
from pvid.configuration.strong import StrongDesign, reference_of, strong_design
from pvid.configuration.strong_q31 import strong_design_to_identify
from pvid.identification.analysis import analysed, refuse_constant
from pvid.identification.answer import Answer, Value
from pvid.identification.values import unless_held, values_of
from pvid.model.compiled import CompiledModel
from pvid.oracle.weak.failures import attempted
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.parameters import UNKNOWN
from pvid.oracle.weak.verdict import Judged, Verdict
from pvid.oracle.weak.verdict import Reason as Doubt
from pvid.rig.run import Recording
from pvid.settings.cores import STRONG, STRONG_CORES, STRONG_FIXED
from pvid.settings.enums import Law, Reason

_UNKNOWN_OF_RANGE = 0.5  # as in the verdict of the weak form
_ROUNDING = 1e-6  # of the value: float32, of what constraints fix
_GOOD = (Reason.UPDATED, Reason.MISFIT, Reason.ACCUMULATED)
_DISTANCE = "their distance from the weak form"
_BIAS = (
    "The strong form differentiates the samples, and their noise biases its regressors; the standard errors contain {}"
    ". The weak form (omit --form strong) has no such bias."
)


@dataclass(frozen=True, eq=False)
class StrongAnswer(Answer):
    """An identification by the strong form.

    Attributes
    ----------
    model : with the values of the rig file
    design : window and settings
    values : by name: outputs of the model, then p
    core : arithmetic
    reason : of the last tick; None in float64
    hash : running hash after the last tick; None in float64
    judged : what it may be used for
    unknown : parameters that the recording does not determine
    recording : the samples
    """

    model: CompiledModel
    design: StrongDesign
    values: Mapping[str, Value]
    core: str
    reason: Reason | None
    hash: int | None
    judged: Verdict
    unknown: tuple[str, ...]
    recording: Recording
    advice: tuple[str, ...] = ()

    @property
    def identified(self) -> bool:
        """Whether every parameter is."""
        return not self.unknown and (self.reason is None or self.reason in _GOOD)

    @property
    def verdict(self) -> Verdict:
        """What the values may be used for."""
        return self.judged

    @property
    def identifier(self) -> str:
        """Form and arithmetic."""
        core = STRONG_CORES.get(self.core)
        return f"strong form, {'float64' if core is None else f'C in {core.words}'}"

    @property
    def method(self) -> list[str]:
        """The differentiators, and the end of the core's run."""
        config = self.design.config
        ends = "" if self.hash is None or self.reason is None else f"; {self.reason.text}; hash {self.hash:08x}"
        return [f"derivatives over {config.window} samples, {config.window / config.sample_rate:.3g} s{ends}"]

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        config = self.design.config
        return super().as_json() | {
            "window_s": config.window / config.sample_rate,
            "reason": None if self.reason is None else self.reason.text,
            "hash": None if self.hash is None else f"{self.hash:08x}",
            "core": self.core,
            "form": "strong",
        }


def identify_strong_mechanism(
    recording: Recording, model: CompiledModel, core: str = STRONG.name, law: Law = Law.STATIONARY
) -> StrongAnswer:
    """Parameters of a mechanism from a recording without missing samples: by the C core, or by the analysis alone.

    Raises PvidError when the recording is too short, or the strong form of the model needs what the core does not have.

    Parameters
    ----------
    core : f32, q31; f64: the analysis
    """
    refuse_constant(recording, model)
    weak = attempted(lambda: analysed(recording, model).found)
    reference = reference_of(weak)
    fixed = strong_design_to_identify(model, recording, law, reference) if core == STRONG_FIXED.name else None
    design = strong_design(model, recording, law, reference) if fixed is None else fixed.base
    fitted = design.fitted
    reason: Reason | None = None
    running: int | None = None
    p, noise = fitted.p, fitted.noise
    if fixed is not None:
        stepped = StrongNativeQ31(fixed.strong_q31).started()
        record = stepped.run_samples(fixed.counts, sums=False)
        p = fixed.strong_q31.values(record.p[-1])
        noise = np.maximum(noise, fixed.strong_q31.values(stepped.assess()["se"][: len(p)]))
        reason, running = _last(record.reason.tolist()), stepped.running_hash
    elif core == STRONG.name:
        rows_alone = replace(design.config, shared=None)
        identifier = strong_native(design.strong, rows_alone).identifier_of(rows_alone)
        record = identifier.run_samples(design.samples, sums=False)
        p = record.p[-1].astype(np.float64)
        n_p = len(p)
        noise = np.maximum(noise, identifier.assess()["se"][:n_p].astype(np.float64))
        reason, running = _last(record.reason.tolist()), identifier.running_hash
    unknown = tuple(_unknown(model, p, np.hypot(noise, fitted.shared)))
    identified = not unknown and (reason is None or reason in _GOOD)
    held = None if identified else "the strong form does not determine every parameter"
    judged = unless_held([Judged()] * len(p), held)
    # What another window or the weak form changes is common to all parameters, as a gain is.
    found = () if weak is None else zip(model.p_names, weak.judged, strict=True)
    lost = [name for name, one in found if one.status == "not_identified"]
    verdict = Verdict((*_doubts(model, p, design, noise, unknown, held), *_not_in_weak(lost, unknown)))
    shared = np.stack([fitted.change, fitted.bias])
    values = values_of(model, p, np.diag(noise**2), shared, judged, verdict, of_known=False)
    return StrongAnswer(model, design, values, core, reason, running, verdict, unknown, recording)


def _last(reasons: list[int]) -> Reason:
    """The last reason that is not ordinary waiting."""
    ends = [one for one in reasons if one not in (Reason.WARMING_UP, Reason.ACCUMULATED)]
    return Reason(ends[-1]) if ends else Reason.WARMING_UP


def _unknown(model: CompiledModel, p: Float, error: Float) -> Iterator[str]:
    """Parameters at a bound, or with a standard error that leaves nothing of them; not the margin of an inequality."""
    in_rows = {symbol for row in model.rows for theta in row.theta for symbol in theta.free_symbols}
    for one, value, own in zip(model.unknowns, p, error, strict=True):
        if one.symbol not in in_rows:
            continue
        bound = UNKNOWN * abs(value) if one.positive else _UNKNOWN_OF_RANGE * (one.high - one.low)
        rim = 1e-5 * abs(value) if one.positive else 0.0
        if not own <= bound or value <= one.low + rim or value >= one.high - rim:
            yield one.name


def _not_in_weak(lost: list[str], unknown: tuple[str, ...]) -> Iterator[Doubt]:
    """Of parameters that the weak form does not determine from the same recording."""
    if kept := [one for one in lost if one not in unknown]:
        text = (
            f"The weak form does not determine {listed(kept)} from this recording: the strong form may have them from "
            "the bias of its noise alone."
        )
        yield Doubt("noise", text, of=tuple(kept))


def _doubts(
    model: CompiledModel, p: Float, design: StrongDesign, noise: Float, unknown: tuple[str, ...], held: str | None
) -> Iterator[Doubt]:
    if unknown:
        yield Doubt("not_identified", f"The strong form does not determine {listed(unknown)} from this recording.")
    elif held is not None:
        yield Doubt("not_identified", "The strong form has published no estimate.")
    fitted = design.fitted
    near = [one for one, bias in zip(model.p_names, fitted.bias, strict=True) if bias]
    known = "what another window changes, not all of it"
    if near:
        rest = len(near) < len(p)
        known = f"the distance of {listed(near)} from the weak form, and of the others {known}" if rest else _DISTANCE
    yield Doubt("noise", _BIAS.format(known))
    bounds = np.maximum(CLASH * np.hypot(noise, fitted.error), _ROUNDING * np.abs(fitted.p))
    apart = [one for one, x, y, most in zip(model.p_names, p, fitted.p, bounds, strict=True) if abs(x - y) > most]
    if apart:
        text = f"The C core and the float64 analysis disagree on {listed(apart)}."
        yield Doubt("core", text, of=tuple(apart))
