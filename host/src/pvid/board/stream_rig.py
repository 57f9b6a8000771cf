"""What a stream image (firmware/apps/stream) is made for: an identifier's settings, and the sensors that feed it."""

from __future__ import annotations

import secrets
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.core.native import Native
from pvid.link.frames import MAX_P, Configure, ConfigureQ31, Core, Count, Form, Sample, Source
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.f32 import StrongConfig, WeakConfig
from pvid.settings.q31 import StrongConfigQ31, WeakConfigQ31
from pvid.setup.f32 import config_of
from pvid.setup.q31 import config_for_run, config_of_q31, counts_of, units_of
from pvid.sim.pendulum import standard_sensors

FloatConfig = StrongConfig | WeakConfig
FixedConfig = StrongConfigQ31 | WeakConfigQ31
Samples = npt.NDArray[Any]  # float32 [rad], [m], or int32 counts

_SLOWEST = 1.0  # ticks a second: the image counts the time between two samples in 32 bits of nanoseconds


@dataclass(frozen=True)
class StreamRig:
    """Settings of an identifier, and the sensors that a board samples by itself.

    Parameters
    ----------
    config
        Core, form and settings.
    sample_rate
        Ticks a second.
    l1
        Length of rod 1 [m].
    phi_lsb, y_lsb
        What a count of the board's own sensors is worth [rad], [m]; rounded to float32, as the image holds it.
    """

    config: FloatConfig | FixedConfig
    sample_rate: float
    l1: float
    phi_lsb: float
    y_lsb: float

    def __post_init__(self) -> None:
        if not self.sample_rate >= _SLOWEST:
            raise PvidError(f"sample_rate is {self.sample_rate:g} Hz, and a board streams at 1 Hz and more")

    @property
    def core(self) -> Core:
        """Which arithmetic."""
        return Core.Q31 if isinstance(self.config, FixedConfig) else Core.F32

    @property
    def form(self) -> Form:
        """Which form of the model."""
        return Form.STRONG if isinstance(self.config, StrongConfig | StrongConfigQ31) else Form.WEAK

    @property
    def n_p(self) -> int:
        """Number of parameters."""
        return len(self.config.estimator.start)

    @property
    def p_unit(self) -> tuple[float, ...]:
        """One unit of each p in SI, filled up to the places of a frame."""
        units = [1.0] * self.n_p if not isinstance(self.config, FixedConfig) else units_of(self.config).tolist()
        return tuple([*units, *[0.0] * (MAX_P - len(units))])

    def from_counts(self, counts: npt.NDArray[np.int32]) -> tuple[Samples, Samples]:
        """phi and y [n] as the identifier gets them, from what the board's own sensors count [n, 2]."""
        if self.core is Core.Q31:
            return counts[:, 0].astype(np.int32), counts[:, 1].astype(np.int32)
        values = counts.astype(np.float32) * np.array([self.phi_lsb, self.y_lsb], np.float32)
        return values[:, 0], values[:, 1]

    def samples(self, phi: npt.ArrayLike, y: npt.ArrayLike) -> tuple[Samples, Samples]:
        """phi [n] and y [n] as the identifier takes them: float32 in rad and m, or counts."""
        kind = np.int32 if self.core is Core.Q31 else np.float32
        return np.asarray(phi, kind), np.asarray(y, kind)

    def sample(self, phi: Samples, y: Samples) -> Sample | Count:
        """The frame of consecutive samples."""
        return Count.of_values(phi, y) if self.core is Core.Q31 else Sample.of_values(phi, y)

    def hashes(self, native: Native, phi: npt.ArrayLike, y: npt.ArrayLike) -> npt.NDArray[np.uint32]:
        """Running hash after every tick in the core on this machine, uint32 [n]."""
        config = self.config
        if isinstance(config, FixedConfig):
            return native.identifier(config).run(phi, y, sums=False).hash
        identifier = native.identifier(config)
        return identifier.run(phi, y, sums=False).hash

    def configure(
        self,
        settings: int,
        hash_every: int,
        estimate_every: int,
        source: Source = Source.PC,
        first_tick: int = 0,
    ) -> Configure | ConfigureQ31:
        """The frame that configures a board whose image has these `settings`, with a new session number."""
        config, estimator = self.config, self.config.estimator
        common: dict[str, Any] = {
            "session": secrets.randbelow(2**32 - 1) + 1,
            "settings": settings,
            "form": int(self.form),
            "source": int(source),
            "hash_every": hash_every,
            "estimate_every": estimate_every,
            "divider": estimator.divider,
            "first_tick": first_tick,
            **{name: _places(getattr(estimator, name)) for name in ("start", "start_sd", "lower", "upper")},
        }
        if isinstance(config, FixedConfig):
            fixed = config.estimator
            return ConfigureQ31(
                **common,
                row_sd=fixed.row_sd,
                forgetting_groups=fixed.forgetting_groups,
                gain=fixed.gain,
                phi_offset=config.phi_offset,
                y_offset=config.y_offset,
            )
        floats = config.estimator
        return Configure(
            **common,
            law=int(floats.law),
            row_sd=floats.row_sd,
            forgetting_s=floats.forgetting_s,
            feedback_hz=floats.feedback_hz,
        )


def _places(values: npt.ArrayLike) -> tuple[Any, ...]:
    """Filled up with zeros to the places of a frame."""
    given = np.asarray(values).tolist()
    return tuple([*given, *[type(given[0])(0)] * (MAX_P - len(given))])


def stream_rig(
    rig: RigFile, sample_rate: float, run: Run | None = None, start: npt.ArrayLike | None = None
) -> StreamRig:
    """What an image is made for, by a rig file.

    Parameters
    ----------
    run
        That is going to be played, from which the fixed-point core's offsets are taken; None: they are 0.
    start
        p = (w, d1, d2) to start from; the rig file's nominal by default.

    Raises
    ------
    PvidError
        When the settings do not fit the core.
    """
    if rig.identifier.core == "f64":
        raise PvidError("targets hold the cores f32 and q31, and core f64 was asked for")
    config: FloatConfig | FixedConfig
    if rig.identifier.core == "f32":
        config = config_of(rig, sample_rate, start)
    elif run is not None:
        config = config_for_run(rig, run, start)
    else:
        config = config_of_q31(rig, sample_rate, start)
    standard = standard_sensors()  # a simulated sensor counts in something where the rig file does not say
    return StreamRig(
        config=config,
        sample_rate=sample_rate,
        l1=rig.l1,
        phi_lsb=rig.sensor.phi_lsb or standard.phi_lsb,
        y_lsb=rig.sensor.y_lsb or standard.y_lsb,
    )


def played_samples(rig: RigFile, run: Run) -> tuple[npt.NDArray[np.generic], npt.NDArray[np.generic]]:
    """phi and y [n] of a run for the rig file's core: counts of its sensors in fixed point."""
    return counts_of(rig, run) if rig.identifier.core == "q31" else (run.phi, run.y)
