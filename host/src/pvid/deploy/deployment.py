"""What is deployed: a mechanism, a rig's tables, an arithmetic, and a recorded motion for the example."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from pvid.configuration.excitation import Excitation
from pvid.deploy.arithmetic import Arithmetic
from pvid.settings.enums import Reason
from pvid.twin.fnv import START, fold_bytes

Files = dict[str, str]


@dataclass(frozen=True)
class Quantity:
    """A sample of a tick or a parameter.

    Attributes
    ----------
    name, unit : as in the model; "" is no unit
    scale : fixed point: value of one count or of one unit of the integer; float32: 1
    note : more about it, for a README
    """

    name: str
    unit: str
    scale: float = 1.0
    note: str = ""


@dataclass(frozen=True)
class Turning:
    """A sample that may turn without end, from the raw counter of its encoder.

    Attributes
    ----------
    name, place : among the samples
    channel : of the model, which it is
    lsb : of a count
    limit : count from the reference at which that moves
    """

    name: str
    place: int
    channel: int
    lsb: float
    limit: int


@dataclass(frozen=True, eq=False)
class Playback:
    """A recorded motion that the example identifies in place of sensors.

    Attributes
    ----------
    counts : int32 [ticks, samples]
    lsb : value of a count [samples]
    value, error : what the core has published at the end [parameters]; None: nothing
    held : outcome of the last window of a motion that brings nothing
    """

    counts: npt.NDArray[np.int32]
    lsb: tuple[float, ...]
    value: npt.NDArray[np.float64] | None
    error: npt.NDArray[np.float64] | None
    held: Reason | None = None


@dataclass(frozen=True, eq=False)
class SecondStage:
    """The refinement of a mechanism.

    Attributes
    ----------
    parameters : r
    value, error : of the refined estimate at the end of the example's motion [parameters]; None: nothing is refined
    held : outcome of the last block then
    """

    parameters: tuple[Quantity, ...]
    value: npt.NDArray[np.float64] | None
    error: npt.NDArray[np.float64] | None
    held: Reason


@dataclass(frozen=True)
class Most:
    """Of a tick on a Cortex-M4F.

    Attributes
    ----------
    bound, longest : instructions by the code, and in a search with spoilt samples
    stack : [bytes]
    """

    bound: int
    longest: int
    stack: int


@dataclass(frozen=True, eq=False)
class Deployment:
    """A mechanism for a rig.

    Attributes
    ----------
    name : of the mechanism, in C
    title : in words
    arithmetic : float32 or fixed point
    sample_rate : [Hz]
    samples : the argument of a step
    parameters : what is identified
    sizes : PVID_MAX_ macro -> value, the smallest that hold the design
    generated : name -> text of the model's and the rig's files
    command : that makes it; no date
    first_s : of motion up to the first window that is judged [s]
    second : the refinement; None: the package has none
    turning : samples that may turn without end
    excitation : of the commissioning; None: the package has none
    causes : of the shared errors, as of WeakConfig
    warnings : of the analysis of the recording that it is made for
    most : of a tick of the first stage; None: not asked for
    """

    name: str
    title: str
    arithmetic: Arithmetic
    sample_rate: float
    samples: tuple[Quantity, ...]
    parameters: tuple[Quantity, ...]
    sizes: Mapping[str, int]
    generated: Mapping[str, str]
    command: str
    first_s: float
    playback: Playback = field(repr=False)
    second: SecondStage | None = None
    turning: tuple[Turning, ...] = ()
    excitation: Excitation | None = None
    causes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    most: Most | None = None

    @property
    def is_refined(self) -> bool:
        """Whether the second stage has an estimate of the example's motion."""
        return self.second is not None and self.second.value is not None

    @property
    def core(self) -> str:
        """As in the names of functions in C."""
        return self.arithmetic.core

    @property
    def begin(self) -> str:
        """The function that starts the example."""
        return f"{self.name}_begin" if self.second is None else f"{self.name}_begin_refined"

    @property
    def upper(self) -> str:
        """NAME."""
        return self.name.upper()

    @property
    def library(self) -> str:
        """Name of the package."""
        return f"pvid_{self.name}"

    @property
    def mechanism(self) -> int:
        """Hash of the names and units of the parameters: a record of others is refused."""
        return fold_bytes(START, "".join(f"{one.name}\0{one.unit}\0" for one in self.parameters).encode())

    @property
    def record_bytes(self) -> int:
        """PVID_RECORD_BYTES of pvid/record.h."""
        return 16 + 7 * len(self.parameters) + len(self.parameters) ** 2

    @property
    def sample_type(self) -> str:
        """In C."""
        return self.arithmetic.sample_type

    @property
    def banner(self) -> str:
        """First line of a file that is made."""
        return f"Generated by `{self.command}`: do not edit."
