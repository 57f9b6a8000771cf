"""A mechanism as the rest of the package sees it: names, units and words of its channels, constants and parameters,
and the map from the parameters p that are identified to the physical ones.

A mechanism is defined in its own folder (pvid.models.kapitza); registry.MODELS contains them by name.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Float = npt.NDArray[np.float64]
Constants = Mapping[str, float]


@dataclass(frozen=True)
class Quantity:
    """A number with a name.

    Attributes
    ----------
    name : in commands, files and JSON
    unit : in SI, in ASCII as in "m/s^2"; "" for a pure number
    meaning : in words
    symbol : as people write it; "" where that is the name
    """

    name: str
    unit: str
    meaning: str
    symbol: str = ""

    @property
    def shown(self) -> str:
        """The symbol."""
        return self.symbol or self.name

    @property
    def shown_unit(self) -> str:
        """The unit for pages and pictures, as in "m/s²"."""
        return self.unit.replace("^2", "²")

    @property
    def name_and_unit(self) -> str:
        """As in "w [1/s^2]", for tables."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name

    @property
    def label(self) -> str:
        """As in "gravity in the plane g* [m/s²]", for axes."""
        return f"{self.meaning} {self.shown}" + (f" [{self.shown_unit}]" if self.unit else "")


@dataclass(frozen=True)
class Channel(Quantity):
    """A recorded signal.

    Attributes
    ----------
    short : in one word
    shown_in : a unit for pages and terminals, and how many of it are one of SI; ("", 1): that of SI
    usual_names : regular expression of likely column names of this signal
    held : it keeps each value until the next one: a blank cell is no change
    """

    short: str = ""
    shown_in: tuple[str, float] = ("", 1.0)
    usual_names: str = "(?!)"
    held: bool = False

    @property
    def shown_unit(self) -> str:
        """The unit for pages and terminals."""
        return self.shown_in[0] or super().shown_unit


@dataclass(frozen=True)
class Constant(Quantity):
    """A number that the user measures; `example` is one as a user would type it."""

    example: str = "1"


@dataclass(frozen=True)
class Parameter(Quantity):
    """An entry of p.

    Attributes
    ----------
    role
        "mapped": positive, the physical parameters follow from these; "offset": of a sensor, of either sign;
        "nuisance": estimated on request, not published.
    """

    role: Literal["mapped", "offset", "nuisance"] = "mapped"


@dataclass(frozen=True)
class Scale:
    """A scale, such as a sensor's gain, whose error changes no residual; it is added to the standard errors.

    Attributes
    ----------
    name : of its part of a standard error
    sd_key : key of the rig file that holds its standard deviation, relative
    meaning : in words
    p : d log p / d log scale of the mapped parameters
    physical : likewise of the physical parameters, beside what reaches them through p
    """

    name: str
    sd_key: str
    meaning: str
    p: tuple[float, ...]
    physical: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class Model:
    """A mechanism.

    Attributes
    ----------
    name, title : in rig files; in a few words
    channels, constants : recorded signals, and known constants
    parameters : p in the order of the core: mapped, then offset, then nuisance; kappa refers to the first one
    physical : parameters that follow from the mapped ones and the constants
    physical_of : (mapped p [..., n_mapped], constants) -> [..., n_physical]; NaN outside the physical region
    gradient_of : likewise, d physical / d p [..., n_physical, n_mapped]
    mapped_of : (physical [n_physical], constants) -> mapped p, the inverse
    is_plausible : whether p, at least the mapped ones, can be that of a rig
    scales : scales whose errors are part of the standard errors
    """

    name: str
    title: str
    channels: tuple[Channel, ...]
    constants: tuple[Constant, ...]
    parameters: tuple[Parameter, ...]
    physical: tuple[Quantity, ...]
    physical_of: Callable[[npt.ArrayLike, Constants], Float]
    gradient_of: Callable[[npt.ArrayLike, Constants], Float]
    mapped_of: Callable[[npt.ArrayLike, Constants], Float]
    is_plausible: Callable[[Float], bool]
    scales: tuple[Scale, ...] = ()

    @property
    def p_names(self) -> tuple[str, ...]:
        """Names of all of p."""
        return tuple(one.name for one in self.parameters)

    @property
    def published(self) -> tuple[Parameter, ...]:
        """Parameters but for the nuisances."""
        return tuple(one for one in self.parameters if one.role != "nuisance")

    @property
    def mapped_names(self) -> tuple[str, ...]:
        """Names of the parameters that the physical ones follow from."""
        return tuple(one.name for one in self.parameters if one.role == "mapped")

    @property
    def n_mapped(self) -> int:
        """How many these are: the first of p."""
        return len(self.mapped_names)

    @property
    def offset_name(self) -> str:
        """Name of the sensor's offset; "" where there is none."""
        return next((one.name for one in self.parameters if one.role == "offset"), "")

    @property
    def physical_names(self) -> tuple[str, ...]:
        """Names of the physical parameters."""
        return tuple(one.name for one in self.physical)

    @property
    def answers(self) -> tuple[Quantity, ...]:
        """What an identification gives, in the order in which it is shown: physical, then published parameters."""
        return (*self.physical, *self.published)

    def answer(self, name: str) -> Quantity:
        """The one of `answers` with this name."""
        return next(one for one in self.answers if one.name == name)


@dataclass(frozen=True)
class Mechanism:
    """A model with the values of its constants; None: they are not known, and the physical parameters are NaN.

    Wherever p is taken, its first entries are the mapped parameters; what follows is not read.
    """

    model: Model
    constants: Constants | None = None

    def physical(self, p: npt.ArrayLike) -> Float:
        """Physical parameters at p [..., n], NaN outside the physical region: [..., n_physical]."""
        mapped = self._mapped(p)
        if self.constants is None:
            return np.full((*mapped.shape[:-1], len(self.model.physical)), np.nan)
        return self.model.physical_of(mapped, self.constants)

    def physical_errors(self, p: npt.ArrayLike, covariance: npt.ArrayLike) -> Float:
        """Standard errors of the physical parameters by the delta method, from the covariance of p [..., n, n]."""
        mapped, n = self._mapped(p), self.model.n_mapped
        if self.constants is None:
            return np.full((*mapped.shape[:-1], len(self.model.physical)), np.nan)
        gradient = self.model.gradient_of(mapped, self.constants)
        with np.errstate(all="ignore"):
            of_p = np.asarray(covariance, np.float64)[..., :n, :n]
            return np.asarray(np.sqrt(np.einsum("...ia,...ab,...ib->...i", gradient, of_p, gradient)))

    def mapped(self, physical: npt.ArrayLike) -> Float:
        """The mapped parameters of a mechanism with these physical ones [n_physical]."""
        assert self.constants is not None
        return self.model.mapped_of(physical, self.constants)

    def _mapped(self, p: npt.ArrayLike) -> Float:
        return np.asarray(p, np.float64)[..., : self.model.n_mapped]
