"""Boards of four kinds of mechanism: two shipped ones, one without an input and one in a file of the user's own."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from conftest import ROOT

from pvid.board.mechanism_board import MechanismBoard
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.models.mechanisms import compiled_of
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.settings.record import Record
from pvid.sim.simulated_run import RigSimulation, rig_of_guess

Board = MechanismBoard | MechanismBoardQ31

TICKS = 3600  # some windows more than the first estimate takes
FREE = ROOT / "tests" / "data" / "recordings" / "free_pendulum.py"  # its one signal is an angle
OWN = Path(__file__).with_name("heated_plate.py")
# The arithmetic of each; of a file its sample rate [Hz], and the drive [Hz] and start of a simulated run.
BOARDS = {
    "dc_motor": MechanismBoard,
    "kapitza": MechanismBoardQ31,
    "free_pendulum": MechanismBoard,
    "heated_plate": MechanismBoardQ31,
}
_FILES: dict[str, tuple[Path, float, tuple[float, float], dict[str, float]]] = {
    "free_pendulum": (FREE, 500.0, (0.1, 1.0), {"q": 2.5}),
    "heated_plate": (OWN, 10.0, (0.01, 0.2), {}),
}


def path_of(name: str) -> str | None:
    """What --model needs for a log of the mechanism; None: it is shipped."""
    return str(_FILES[name][0]) if name in _FILES else None


@cache
def board_of_mechanism(name: str, kind: type[Board] | None = None) -> Board:
    """With the sensors' readings of a simulated run of TICKS samples."""
    kind = kind or BOARDS[name]
    if name not in _FILES:
        board = kind.of_shipped_rig(name)
    else:
        path, rate, band, start = _FILES[name]
        compiled = compiled_of(path)
        rig = rig_of_guess(compiled, "steps", *band, rate=rate, duration=TICKS / rate, start=start)
        run = RigSimulation.of(compiled, rig).run()
        board = kind.of_recording(MechanismRig(path, rate), Recording(run.pop("t"), run, rate))
    return replace(board, recording=board.recording[:TICKS])


def core_record(board: Board, readings: npt.NDArray[Any] | None = None) -> Record:
    """Of the C core on this machine: the board's recording, or other readings [ticks, samples]."""
    given = board.recording if readings is None else readings
    if isinstance(board, MechanismBoardQ31):
        engine = board.engine
        return weak_native_q31(engine.made, engine.parameters, engine.config).identifier().run_samples(given)
    return weak_native(board.compiled, board.config.design).identifier_of(board.config).run_samples(given)


def samples_in_si(board: Board) -> npt.NDArray[np.float64]:
    """The recording in the units of the model [ticks, samples]."""
    scale = np.array(board.engine.lsb) if isinstance(board, MechanismBoardQ31) else 1.0
    return board.recording.astype(np.float64) * scale
