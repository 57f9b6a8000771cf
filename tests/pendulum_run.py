"""A recording of a pendulum: its arrays by name, and its files."""

from __future__ import annotations

import os
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from pvid.rig.columns import Channel, Columns, parsed
from pvid.rig.run import Recording, read_recording, write_recording

Float = npt.NDArray[np.float64]

CHANNELS = (Channel("phi", "rad"), Channel("y", "m"))


@dataclass(frozen=True, eq=False)
class Run:
    """Time [s], measured relative angle [rad], height of the pivot [m]; the rest as in a Recording."""

    t: Float
    phi: Float
    y: Float
    sample_rate: float
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.t)

    @classmethod
    def of(cls, recording: Recording) -> Run:
        signals = recording.signals
        return cls(recording.t, signals["phi"], signals["y"], recording.sample_rate, recording.notes)

    @property
    def recording(self) -> Recording:
        return Recording(self.t, {"phi": self.phi, "y": self.y}, self.sample_rate, self.notes)


def columns_of(text: str | None = None) -> Columns:
    """Of the text of --columns, or of their own names."""
    return parsed(text, CHANNELS)


def read_run(path: str | os.PathLike[str], rate: float | None = None, text: str | None = None) -> Run:
    return Run.of(read_recording(path, rate, columns_of(text)))


def write_run(path: str | os.PathLike[str], run: Run) -> None:
    write_recording(path, run.recording, CHANNELS)
