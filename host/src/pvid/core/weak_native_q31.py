"""The fixed-point weak form of a mechanism in C: its library, and an identifier that is stepped through runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.core.headers import Filled
from pvid.core.model_library import ModelSources
from pvid.core.native import Native, Publisher
from pvid.settings.q31 import EstimatorConfigQ31
from pvid.settings.record import Record
from pvid.settings.weak_q31 import WeakConfigQ31


class WeakNativeQ31(Native):
    """A library of pvid.core.model_library, which contains a configuration as well.

    Parameters
    ----------
    name : of the mechanism, in C
    path : of the library
    config : the configuration that it contains
    sources : what it was made of
    """

    def __init__(self, name: str, path: Path, config: WeakConfigQ31, sources: ModelSources) -> None:
        super().__init__(path)
        self.name, self.config, self.sources = name, config, sources

    def identifier(
        self, start: npt.ArrayLike | None = None, estimator: EstimatorConfigQ31 | None = None
    ) -> WeakIdentifierQ31:
        """An initialised identifier.

        Parameters
        ----------
        start : p in the core's formats [n_p]; None: that of the configuration
        estimator : its settings; None: those of the configuration
        """
        return WeakIdentifierQ31(self, start, estimator)


class WeakIdentifierQ31(Publisher):
    """The identifier: readings of every tick in counts."""

    def __init__(
        self, native: WeakNativeQ31, start: npt.ArrayLike | None = None, estimator: EstimatorConfigQ31 | None = None
    ) -> None:
        given = getattr(native.library, f"{native.name}_settings_q31")[0]  # a constant of the library
        self._owned = native.headers.ffi.new("pvid_weak_config_q31 *", given)
        self._config = self._owned[0]
        if estimator is not None:
            self._config.estimator = native.headers.filled("pvid_estimator_config_q31", estimator).struct
        for place, one in enumerate([] if start is None else np.asarray(start, np.int32).tolist()):
            self._config.estimator.start[place] = one
        self.sources = native.sources
        super().__init__(native, "weak", "q31", native.config, replay="weak")

    def _filled_with(self, native: Native, kind: str, config: object) -> Filled:
        """A copy of the configuration in the library."""
        return Filled(self._config, {}, {}, [])

    def run_samples(
        self, readings: npt.ArrayLike, *, sums: bool = True, hashes: bool = True, estimate_every: int = 0
    ) -> Record:
        """Steps through readings [ticks, samples]."""
        given = np.ascontiguousarray(readings, np.int32)
        return self._recorded(len(given), [given], sums, hashes, estimate_every)
