"""The shipped C core, called through a shared library built from the same sources with the same flags."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.core.headers import Filled, Headers, Placed, Tables, default_library
from pvid.core.refusals import refused
from pvid.settings.enums import Core, Status
from pvid.settings.record import Record


class OfEstimator(NamedTuple):
    """An estimator of the core. sizes: its numbers of parameters and of sums; assess: the function in C, of the
    identifier or of the estimator in it."""

    sizes: Callable[[Any], tuple[int, int]]
    assess: str
    of_identifier: bool = False


class Arithmetic(NamedTuple):
    """Properties of a core. sample, sums: numpy types of samples and p, and of the sums; any_model: its estimator."""

    sample: type[np.generic]
    sums: type[np.generic]
    exponents: bool  # of the sums
    misfit_unit: float
    any_model: OfEstimator


def _sizes_f32(one: Any) -> tuple[int, int]:
    return int(one.model.n_p), int(one.information.n_moments + one.information.n_theta + 2)


_ARITHMETIC: dict[Core, Arithmetic] = {
    "f32": Arithmetic(np.float32, np.float32, False, 1.0, OfEstimator(_sizes_f32, "pvid_estimator_assess_f32")),
    "q31": Arithmetic(
        np.int32,
        np.int64,
        True,
        2.0**-16,
        OfEstimator(lambda one: (int(one.model.n_p), int(one.information.n_sums)), "pvid_estimator_assess_q31"),
    ),
}


class Native:
    """One build of the C core.

    Raises PvidError when the library is missing.

    Parameters
    ----------
    path : the shared library; by default the one tools/pvid builds

    Attributes
    ----------
    path : the library
    headers : the declarations that the library was built with
    library : its functions and constants, by their names in C
    """

    def __init__(self, path: Path | None = None) -> None:
        self.path = path or default_library()
        self.headers = Headers.of(self.path)
        try:
            self.library: Any = self.headers.ffi.dlopen(str(self.path))
        except OSError as error:
            raise PvidError(f"cannot load the C core {self.path}: {error}; build it with ./tools/pvid") from error

    @property
    def build(self) -> str:
        """Compiler and flags of this build."""
        return str(self.headers.ffi.string(self.library.pvid_native_build()).decode())


class Stepper:
    """An initialised object of the core in C memory, stepped through runs.

    Its state persists between calls of `run`, so a run may come in pieces.

    Parameters
    ----------
    name, core : pvid_<name>_<core> is its type in C, and the names of its functions likewise
    config : settings with the attributes of the C configuration's fields
    replay : pvid_replay_<replay>_<core> steps it
    also : further settings that its init checks
    given : fields of the C configuration that the settings do not have
    """

    _configured: str | None = None  # pvid_<..>_config_<core> is the configuration's type; None: <name>
    _prefix = "pvid_"  # of its names in C; generated ones have none

    def __init__(
        self, native: Native, name: str, core: Core, config: Any, *, replay: str, also: Sequence[Any] = (), **given: Any
    ) -> None:
        ffi = native.headers.ffi
        self.native = native
        self.core = core
        self._name = name
        self._replay = replay
        self._filled = self._filled_with(native, f"{self._prefix}{self._configured or name}_config_{core}", config)
        for field, value in given.items():
            setattr(self.config_struct, field, value)
        self._hash = np.array([0x811C9DC5], np.uint32)
        self.state: Any = ffi.new(f"{self._prefix}{name}_{core} *")
        status = self.initialise()
        if status is not Status.OK:
            raise PvidError(refused(status, config, *also, in_counts=core == "q31"))
        self._arithmetic = _ARITHMETIC[core]
        self._kind = self._kind_of(self._arithmetic)
        self.n_p, self._n_sums = self._kind.sizes(self.estimator)

    def _filled_with(self, native: Native, kind: str, config: Any) -> Filled:
        """The configuration in C."""
        return native.headers.filled(kind, config)

    def _call(self, verb: str, *arguments: Any) -> Any:
        """Its function pvid_<name>_<verb>_<core>."""
        return getattr(self.native.library, f"{self._prefix}{self._name}_{verb}_{self.core}")(self.state, *arguments)

    def _kind_of(self, arithmetic: Arithmetic) -> OfEstimator:
        """Its estimator."""
        return arithmetic.any_model

    def initialise(self) -> Status:
        """Runs init on the present configuration."""
        library = self.native.library
        if hasattr(library, f"{self._prefix}{self._name}_init_layout_{self.core}"):
            return Status(self._call("init_layout", self.config_pointer, library.pvid_layout()))
        return Status(self._call("init", self.config_pointer))

    @property
    def config_struct(self) -> Any:
        """The configuration in C."""
        return self._filled.struct

    @property
    def config_pointer(self) -> Any:
        """Its address."""
        return self.native.headers.ffi.addressof(self._filled.struct)

    @property
    def tables(self) -> Tables:
        """The tables that the configuration points to, by field."""
        return self._filled.tables

    @property
    def state_bytes(self) -> bytes:
        """The object in C memory."""
        return bytes(self.native.headers.ffi.buffer(self.state))

    @property
    def placed(self) -> list[Placed]:
        """Its objects in C memory."""
        return [self.native.headers.placed(self.state)]

    @property
    def estimator(self) -> Any:
        """pvid_estimator_<core> in it."""
        return self.state[0]

    @property
    def estimate(self) -> npt.NDArray[np.void]:
        """What it publishes."""
        return self.assess()[()]

    @property
    def publishes(self) -> bool:
        """Whether it publishes trusted estimates only."""
        return False

    @property
    def _estimate_type(self) -> np.dtype[Any]:
        return self.native.headers.dtype(f"pvid_estimate_{self.core}")

    def run(
        self,
        first: npt.ArrayLike,
        second: npt.ArrayLike,
        *,
        sums: bool = True,
        hashes: bool = True,
        estimate_every: int = 0,
    ) -> Record:
        """Steps through phi and y, both [ticks], or rows N [ticks, n_theta] and Y [ticks].

        Floats are converted to float32 as a board would read them; the fixed-point core takes counts.
        """
        sample = self._arithmetic.sample
        samples = [np.ascontiguousarray(x, sample) for x in (first, second)]
        return self._recorded(len(samples[1]), samples, sums, hashes, estimate_every)

    def _recorded(
        self, ticks: int, samples: Sequence[npt.NDArray[Any]], sums: bool, hashes: bool, estimate_every: int
    ) -> Record:
        """Replays arrays of one entry a tick."""
        sample = self._arithmetic.sample
        published = (ticks if self.publishes else 0, self.n_p)
        record = Record(
            p=np.empty((ticks, self.n_p), sample),
            sums=np.empty((ticks if sums else 0, self._n_sums), self._arithmetic.sums),
            exponent=np.empty(ticks if self._arithmetic.exponents else 0, np.uint8),
            reason=np.empty(ticks, np.uint8),
            hash=np.empty(ticks if hashes else 0, np.uint32),
            published=np.empty(published, sample),
            published_se=np.empty(published, sample),
            standing=np.empty(published[0], np.uint32),
            estimate=np.empty(-(-ticks // estimate_every) if estimate_every else 0, self._estimate_type),
        )
        headers = self.native.headers
        struct = headers.ffi.new(f"pvid_record_{self.core} *", {"running_hash": headers.pointer(self._hash)})
        struct.estimate_every = estimate_every
        for name, _ in headers.ffi.typeof(struct[0]).fields:
            array = getattr(record, name, None)
            if array is not None and len(array):
                setattr(struct, name, headers.pointer(array))
        replay = getattr(self.native.library, f"pvid_replay_{self._replay}_{self.core}")
        replay(self.state, ticks, *map(headers.pointer, samples), struct)
        return record

    @property
    def running_hash(self) -> int:
        """FNV-1a after the last recorded tick."""
        return int(self._hash[0])

    @running_hash.setter
    def running_hash(self, value: int) -> None:
        self._hash[0] = value

    @property
    def counters(self) -> dict[str, int]:
        """pvid_counters by name."""
        counters = self.estimator.counters
        return {name: int(getattr(counters, name)) for name, _ in self.native.headers.ffi.typeof(counters).fields}

    def assess(self) -> npt.NDArray[np.void]:
        """Standard errors and kappa at the present state: pvid_estimate_<core>, shape ()."""
        headers = self.native.headers
        out = np.empty((), self._estimate_type)
        assess = getattr(self.native.library, self._kind.assess)
        assess(self.state if self._kind.of_identifier else headers.ffi.addressof(self.estimator), headers.pointer(out))
        return out

    def freeze(self, frozen: bool) -> None:
        """Freezes (True) or resumes (False) an identifier."""
        self._call("freeze", frozen)

    def gap(self) -> None:
        """Samples of an identifier are missing before the next call of `run`."""
        self._call("gap")


class Publisher(Stepper):
    """An identifier that publishes: the weak form's state in C."""

    @property
    def estimator(self) -> Any:
        """pvid_estimator_<core> in it."""
        return self.state.estimator

    @property
    def publishes(self) -> bool:
        """Whether it publishes trusted estimates only."""
        return True

    def run_in_blocks(self, samples: npt.ArrayLike, ticks: int) -> npt.NDArray[np.uint32]:
        """Steps through samples [all ticks, samples] in blocks of so many ticks.

        Returns
        -------
        Running hash [all ticks], in a block that behind it.
        """
        given = np.ascontiguousarray(samples, self._arithmetic.sample)
        pointer, estimator = self.native.headers.pointer, self.native.headers.ffi.addressof(self.estimator)
        of_tick = getattr(self.native.library, f"pvid_fnv_estimator_{self.core}")
        hashes = np.empty(len(given), np.uint32)
        for first in range(0, len(given), ticks):
            block = given[first : first + ticks]
            reason = self._call("step_block", pointer(block), len(block))
            self.running_hash = of_tick(self.running_hash, estimator, reason)
            hashes[first : first + ticks] = self.running_hash
        return hashes

    @property
    def is_published(self) -> bool:
        """Whether an estimate has been published yet."""
        return self.publishes and bool(self.state.trust.published)

    @property
    def estimate(self) -> npt.NDArray[np.void]:
        """The published estimate (before the first one the start)."""
        return self.native.headers.viewed(self.state.trust.estimate) if self.publishes else self.assess()

    @property
    def published(self) -> npt.NDArray[np.void] | None:
        """The published estimate; None until there is one."""
        return self.estimate if self.is_published else None

    @property
    def misfit(self) -> float:
        """Residual variance of the estimate's rows over its expectation from the sensors' noise; NaN: not judged."""
        return float(self.estimate["misfit"]) * self._arithmetic.misfit_unit or math.nan
