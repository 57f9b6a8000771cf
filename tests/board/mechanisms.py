"""Boards of five kinds of mechanism: two shipped ones, one without an input and two in files of the user's own."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
from own_mechanisms import OWN, TICKS, own_recording

from pvid.board.mechanism_board import MechanismBoard
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.record import Record

Board = MechanismBoard | MechanismBoardQ31

# The arithmetic of each.
BOARDS = {
    "dc_motor": MechanismBoard,
    "kapitza": MechanismBoardQ31,
    "free_pendulum": MechanismBoard,
    "heated_plate": MechanismBoardQ31,
    "mass_chain": MechanismBoard,
}


def path_of(name: str) -> str | None:
    """What --model needs for a log of the mechanism; None: it is shipped."""
    return str(OWN[name].path) if name in OWN else None


@cache
def board_of_mechanism(name: str, kind: type[Board] | None = None) -> Board:
    """With the sensors' readings of a simulated run of TICKS samples."""
    kind = kind or BOARDS[name]
    if name in OWN:
        board = kind.of_recording(MechanismRig(OWN[name].path, OWN[name].rate), own_recording(name))
    else:
        board = kind.of_shipped_rig(name)
    if isinstance(board, MechanismBoardQ31):
        return replace(board, recording=board.recording[:TICKS])
    return replace(board, recording=board.recording[:TICKS])


def core_record(board: Board, readings: npt.NDArray[Any] | None = None) -> Record:
    """Of the C core on this machine: the board's recording, or other readings [ticks, samples]."""
    given = board.recording if readings is None else readings
    if isinstance(board, MechanismBoardQ31):
        weak = board.weak
        return weak_native_q31(weak.made, weak.parameters, weak.config).identifier().run_samples(given)
    return weak_native(board.compiled, board.config.design).identifier_of(board.config).run_samples(given)


def samples_in_si(board: Board) -> npt.NDArray[np.float64]:
    """The recording in the units of the model [ticks, samples]."""
    scale = np.array(board.weak.lsb) if isinstance(board, MechanismBoardQ31) else 1.0
    return board.recording.astype(np.float64) * scale
