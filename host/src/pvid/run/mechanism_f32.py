"""Identification of a described mechanism by the C core in float32, compiled for this computer.

The float64 oracle analyses the recording first, for the verdict; then it chooses the engine's design and finds the
equations' own errors. The engine starts at the guesses and runs over the samples as on a board.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pvid.base.errors import PvidError
from pvid.codegen.fourier_library import fourier_native
from pvid.core.fourier_native import FourierIdentifier
from pvid.run.engine_design import config_for_recording, samples_of
from pvid.run.mechanism import MechanismAnswer, Value, gains_of, values_of
from pvid.settings.enums import Reason
from pvid.settings.fourier import FourierConfig
from pvid.settings.record import Record


@dataclass(frozen=True, eq=False)
class CoreAnswer:
    """An identification by the C core, beside that of the oracle.

    Attributes
    ----------
    oracle : of the same recording
    config : of the engine
    values : by name: outputs of the model, then p; of the last published estimate
    published : whether there is one
    reason : of the last window
    misfit : of the published estimate; None: not judged
    windows : how many the engine has judged
    hash : running hash of its state after the last tick
    """

    oracle: MechanismAnswer
    config: FourierConfig
    values: Mapping[str, Value]
    published: bool
    reason: Reason
    misfit: float | None
    windows: int
    hash: int

    @property
    def identified(self) -> bool:
        """Whether the core has published, and the recording shows every parameter."""
        return self.published and self.oracle.identified

    def as_json(self) -> dict[str, Any]:
        """The object of `identify --json` (host/docs/index.md)."""
        design = self.config.design
        return self.oracle.as_json() | {
            "identified": self.identified,
            "parameters": {
                name: {"value": one.value, "se": one.se, "unit": one.unit, "se_noise": one.se_noise}
                for name, one in self.values.items()
            },
            "chi2": self.misfit,
            "reason": self.reason.text,
            "window_s": 2 * self.config.hop_s,
            "windows": self.windows,
            "functions": design.functions,
            "decimation": design.decimation,
            "hash": f"{self.hash:08x}",
            "core": "f32",
        }


def identify_in_c(answer: MechanismAnswer) -> CoreAnswer:
    """The same recording by the C core.

    Raises
    ------
    PvidError
        When there is no C compiler, or the engine does not have what the model needs.
    """
    recording, compiled = answer.recording, answer.model
    try:
        config = config_for_recording(compiled, recording)
        native = fourier_native(compiled, config.design)
        identifier = native.identifier_of(config)
    except PvidError as error:
        raise PvidError(f"--core f32: {error}") from error
    record = identifier.run_samples(samples_of(config, recording.signals), sums=False)
    return _answer(answer, config, identifier, record)


def _answer(
    answer: MechanismAnswer, config: FourierConfig, identifier: FourierIdentifier, record: Record
) -> CoreAnswer:
    estimate = identifier.published
    model, found = answer.model, answer.found
    ends = record.reason[(record.reason != Reason.WARMING_UP) & (record.reason != Reason.ACCUMULATED)]
    n_p = len(found.p)
    last = identifier.estimate
    covariance = np.asarray(last["covariance"], np.float64)[:n_p, :n_p]
    values = values_of(
        model,
        np.asarray(last["p"][:n_p], np.float64),
        covariance,
        gains_of(model, found),
        identified=estimate is not None and answer.identified,
    )
    misfit = identifier.misfit
    return CoreAnswer(
        oracle=answer,
        config=config,
        values=values,
        published=estimate is not None,
        reason=Reason(int(ends[-1])) if len(ends) else Reason.WARMING_UP,
        misfit=None if estimate is None or np.isnan(misfit) else misfit,
        windows=int(len(ends)),
        hash=identifier.running_hash,
    )
