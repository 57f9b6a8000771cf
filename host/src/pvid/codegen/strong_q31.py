"""The fixed-point strong form of a model: the formats of its rows from the reach of each derivative."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.codegen.fixed_model import symmetric
from pvid.codegen.formats import FixedProgram, Interval, bits_of, fixed
from pvid.codegen.functions import RowKind
from pvid.codegen.strong import StrongFunctions
from pvid.codegen.weak_q31 import ParametersQ31, fixed_parameters, limits_of
from pvid.settings.strong import StrongModelConfigQ31


@dataclass(frozen=True, eq=False)
class FixedStrong:
    """Fixed-point functions of the strong form.

    Attributes
    ----------
    strong : what is generated, named NAME_strong
    reaches : largest value of each input of the rows
    row : inputs -> N, Y of each kind, one kind after the other
    limits : largest integer of each input
    integrands : rates of the integrals since the start of the run, from the signals among the inputs; None: none
    parameters : functions of p
    """

    strong: StrongFunctions
    reaches: tuple[float, ...]
    row: FixedProgram
    limits: tuple[int, ...]
    integrands: FixedProgram | None
    parameters: ParametersQ31

    @property
    def name(self) -> str:
        """In C."""
        return self.strong.functions.name

    @property
    def input_bits(self) -> tuple[int, ...]:
        """Format of each input."""
        return tuple(bits_of(symmetric(one)) for one in self.reaches)

    def columns(self, kind: RowKind) -> slice:
        """Places of the N of a kind among the entries; its Y follows."""
        return slice(kind.columns.start, kind.known)


def fixed_strong(strong: StrongFunctions, reaches: Sequence[float], bounds: Sequence[Interval]) -> FixedStrong:
    """Formats of the rows; `bounds`: of p. Raises PvidError where fixed point cannot compute the rows, theta or C."""
    functions = strong.functions
    functions.model.refuse_constraints("fixed point")
    given = [symmetric(one) for one in reaches]
    row = fixed(strong.row.program, given, f"{functions.name}, row")
    rates = functions.integrands.program
    integrands = fixed(rates, given, f"{functions.name}, integrands") if strong.integrals else None
    return FixedStrong(strong, tuple(reaches), row, limits_of(given), integrands, fixed_parameters(functions, bounds))


@dataclass(frozen=True, eq=False)
class StrongQ31:
    """A mechanism's fixed-point strong form for a rig.

    Attributes
    ----------
    made : its functions
    config : settings and tables
    lsb : value of a count of each signal [signals]
    """

    made: FixedStrong
    config: StrongModelConfigQ31
    lsb: tuple[float, ...]

    @property
    def name(self) -> str:
        """In C."""
        return self.made.name

    @property
    def sizes(self) -> dict[str, int]:
        """Of the core's arrays."""
        model = self.made.parameters.model
        return {
            "PVID_MAX_P": model.n_p,
            "PVID_MAX_WINDOW": self.config.memory,
            "PVID_MAX_THETA_Q31": model.n_theta,
            "PVID_MAX_MOMENTS_Q31": model.moments,
            "PVID_MAX_C_Q31": len(model.c_row),
        }

    def values(self, p: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Parameters, or standard errors, from their integers [..., n_p]."""
        return np.asarray(p, np.float64) * 2.0 ** -np.array(self.made.parameters.p_bits, np.float64)
