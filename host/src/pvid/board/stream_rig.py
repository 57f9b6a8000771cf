"""What a stream image (firmware/apps/stream) is made for: an identifier's settings, and the sensors that feed it."""

from __future__ import annotations

import secrets
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.cases import Case, Samples, case_of
from pvid.core.native import Native
from pvid.link.frames import MAX_P, Configuration, Core, Form, Message, Source
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.kinds import Settings
from pvid.sim.pendulum import standard_sensors

SLOWEST = 1.0  # ticks a second: the image counts the time between two samples in 32 bits of nanoseconds
MOST_TICKS = 40_000  # of a simulation that an image contains


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

    config: Settings
    sample_rate: float
    l1: float
    phi_lsb: float
    y_lsb: float

    def __post_init__(self) -> None:
        if not self.sample_rate >= SLOWEST:
            raise PvidError(f"sample_rate is {self.sample_rate:g} Hz, and a board streams at 1 Hz and more")

    @property
    def case(self) -> Case:
        """What belongs to the settings' form and core."""
        return case_of(self.config)

    @property
    def core(self) -> Core:
        """Which arithmetic, as a frame numbers it."""
        return self.case.numbers[1]

    @property
    def form(self) -> Form:
        """Which form of the model, likewise."""
        return self.case.numbers[0]

    @property
    def n_p(self) -> int:
        """Number of parameters."""
        return len(self.config.estimator.start)

    @property
    def p_unit(self) -> tuple[float, ...]:
        """One unit of each p in SI, filled up to the places of a frame."""
        units = self.case.units(self.config).tolist()
        return tuple([*units, *[0.0] * (MAX_P - len(units))])

    def from_counts(self, counts: npt.NDArray[np.int32]) -> tuple[Samples, Samples]:
        """phi and y [n] as the identifier gets them, from what the board's own sensors count [n, 2]."""
        return self.case.from_counts(counts, (self.phi_lsb, self.y_lsb))

    def readings(self, *signals: npt.ArrayLike) -> Samples:
        """phi [n] and y [n] as the identifier takes them [n, 2]: float32 in rad and m, or counts."""
        return np.stack([np.asarray(one, self.case.sample_type) for one in signals], axis=1)

    def frame(self, readings: Samples) -> Message:
        """The frame of consecutive ticks [n, 2]."""
        made: Message = self.case.frame.of_values(*readings.T)
        return made

    def hashes(self, native: Native, *signals: npt.ArrayLike) -> npt.NDArray[np.uint32]:
        """Running hash after every tick in the core on this machine, uint32 [n]."""
        phi, y = signals
        return native.identifier(self.config).run(phi, y, sums=False).hash

    def configure(
        self,
        settings: int,
        hash_every: int,
        estimate_every: int,
        source: Source = Source.PC,
        first_tick: int = 0,
    ) -> Configuration:
        """The frame that configures a board whose image has these `settings`, with a new session number."""
        return self.case.configure(
            self.config,
            session=secrets.randbelow(2**32 - 1) + 1,
            settings=settings,
            form=int(self.form),
            source=int(source),
            hash_every=hash_every,
            estimate_every=estimate_every,
            first_tick=first_tick,
        )


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
    case = case_of(rig.identifier)
    standard = standard_sensors()  # resolution of a simulated sensor, if the rig file has none
    return StreamRig(
        config=case.settings(rig, sample_rate, start) if run is None else case.settings_for_run(rig, run, start),
        sample_rate=sample_rate,
        l1=rig.l1,
        phi_lsb=rig.sensor.phi_lsb or standard.phi_lsb,
        y_lsb=rig.sensor.y_lsb or standard.y_lsb,
    )


def played_samples(rig: RigFile, run: Run) -> tuple[Samples, Samples]:
    """phi and y [n] of a run for the rig file's core: counts of its sensors in fixed point."""
    return case_of(rig.identifier).samples(rig, run)
