"""The weak form of a compiled mechanism in C: its library, and an identifier that is stepped through runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.core.native import Native, Publisher
from pvid.settings.fourier import Float32, FourierConfig
from pvid.settings.record import Record


class FourierNative(Native):
    """A library of pvid.core.model_library.

    Parameters
    ----------
    name : of the mechanism, in C
    path : of the library
    """

    def __init__(self, name: str, path: Path) -> None:
        super().__init__(path)
        self.model: Any = self.headers.ffi.addressof(self.library, f"{name}_fourier_f32")

    def identifier_of(self, config: FourierConfig) -> FourierIdentifier:
        """An initialised identifier."""
        return FourierIdentifier(self, config)

    def values(self, inputs: npt.ArrayLike) -> Float32:
        """The generated function: gains, then integrands [vectors, results] from inputs [vectors, inputs]."""
        return self._called(self.model.values, inputs, int(self.model.gains + self.model.integrands))

    def prepared(self, jets: npt.ArrayLike) -> Float32:
        """The generated function: derivatives of the runs, then arguments of signs [vectors, results]."""
        return self._called(self.model.prepare, jets, int(self.model.runs + self.model.signs))

    def theta(self, p: npt.ArrayLike) -> Float32:
        """theta [vectors, n_theta] from p [vectors, n_p]."""
        return self._called(self.model.model.theta, p, int(self.model.model.n_theta))

    def jacobian(self, p: npt.ArrayLike) -> Float32:
        """Non-zeros of d theta / d p [vectors, n_c]."""
        return self._called(self.model.model.jacobian, p, int(self.model.model.n_c))

    def _called(self, function: Any, inputs: npt.ArrayLike, results: int) -> Float32:
        given = np.ascontiguousarray(inputs, np.float32)
        out = np.zeros((len(given), results), np.float32)
        pointer = self.headers.pointer
        self.library.pvid_replay_function_f32(
            function, len(given), given.shape[1], results, pointer(given), pointer(out)
        )
        return out


class FourierIdentifier(Publisher):
    """The identifier: samples of every tick in the units of the model."""

    def __init__(self, native: FourierNative, config: FourierConfig) -> None:
        self._model = native.model
        self.config = config
        super().__init__(native, "fourier", "f32", config, replay="fourier")

    def initialise(self) -> Any:
        """Runs init on the present configuration, with the library's model."""
        self._filled.designs["design"].model = self._model
        return super().initialise()

    def run_samples(
        self, samples: npt.ArrayLike, *, sums: bool = True, hashes: bool = True, estimate_every: int = 0
    ) -> Record:
        """Steps through samples [ticks, samples], converted to float32 as a board would read them."""
        given = np.ascontiguousarray(samples, np.float32)
        return self._recorded(len(given), [given], sums, hashes, estimate_every)
