"""Float32 and fixed point: what differs in a package."""

from __future__ import annotations

from dataclasses import dataclass

from pvid.settings.cores import FIXED as FIXED_CORE
from pvid.settings.cores import FLOAT as FLOAT_CORE
from pvid.settings.cores import CoreBuild


@dataclass(frozen=True)
class Arithmetic:
    """One of the two.

    Attributes
    ----------
    build : of the core, its name and words
    without : end of the names of sources that it does without
    header : of the identifier; those of its record and its snapshot are named after it
    sample_type : in C
    samples : what a sample is, for a README
    is_integer : samples are counts, and parameters are integers with a scale
    zephyr : settings of a Zephyr application
    """

    build: CoreBuild
    without: str
    header: str
    sample_type: str
    samples: str
    is_integer: bool
    zephyr: str

    @property
    def core(self) -> str:
        """Name, as in the names of functions."""
        return self.build.name


FLOAT = Arithmetic(
    build=FLOAT_CORE,
    without="_q31",
    header="pvid/weak.h",
    sample_type="float",
    samples="float32",
    is_integer=False,
    zephyr="CONFIG_FPU=y\n",
)
FIXED = Arithmetic(
    build=FIXED_CORE,
    without="_f32",
    header="pvid/weak_q31.h",
    sample_type="int32_t",
    samples="integers only, samples in counts of the sensors",
    is_integer=True,
    zephyr="",
)
