"""A year of ticks at 1 kHz: the counter passes 2^32 again and again, and nothing that reads the log notices."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.year import emulated_year, passages_of_a_year
from pvid.board.target import HOST_TARGET
from pvid.log.rig import recording_of_log
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.cores import CORES
from pvid.settings.enums import Core

SAMPLES = 2500  # more than a window


@pytest.mark.parametrize("core", CORES)
def test_passages_of_2_to_the_32_ticks_are_recorded_verified_exported_and_drawn(tmp_path: Path, core: Core) -> None:
    passages = (1, 2, passages_of_a_year(1000.0)) if core == "f32" else (700,)
    log = tmp_path / "a.pvlog"
    year = emulated_year(HOST_TARGET, passages, SAMPLES, log, MechanismRig("kapitza", 1000.0, known={"l1": 0.3}), core)
    assert year.faults == ()
    assert year.passages == len(passages) == len(year.account.segments)
    assert year.verdict.verified > 0.9 * SAMPLES * len(passages)
    assert year.verdict.verified + year.verdict.trailing == year.account.samples
    assert log.with_suffix(".png").stat().st_size > 10_000
    run = recording_of_log(log, ["y", "phi"])
    assert np.allclose(np.diff(run.t), 1e-3, atol=1e-6)
