"""A recording of a described mechanism played to a board, in either arithmetic, against the core on this machine."""

from __future__ import annotations

from collections.abc import Callable

from pvid.board.mechanism_board import MechanismBoard
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.target import Verdict, verify
from pvid.core.native import Native
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.settings.engine_cores import ENGINE_CORES
from pvid.settings.enums import Core

Board = MechanismBoard | MechanismBoardQ31
_BOARDS: dict[str, type[Board]] = dict(zip(ENGINE_CORES, (MechanismBoard, MechanismBoardQ31), strict=True))


def verify_recording(
    target: str,
    rig: MechanismRig,
    recording: Recording,
    core: Core = "f32",
    progress: Callable[[int], None] | None = None,
) -> Verdict:
    """Plays it on a target, with the settings of `identify`; every hash is compared.

    Raises
    ------
    PvidError
        When the target cannot be started or refuses, or the engine does not have what the model needs.
    """
    board = _BOARDS[core].of_recording(rig, recording, to_identify=True)
    samples = board.recording.T
    return verify(target, board.without_recording, Native(), *samples, progress=progress)
