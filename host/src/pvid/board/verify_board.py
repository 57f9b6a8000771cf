"""A recording of a described mechanism played to a board, in either arithmetic, against the core on this machine."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pvid.board.mechanism_board import MechanismBoard, refuse_unrefined
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.target import Verdict, verify
from pvid.core.native import Native
from pvid.oracle.weak.choice import Scored
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import Recording
from pvid.settings.cores import CORES
from pvid.settings.enums import Core

Board = MechanismBoard | MechanismBoardQ31
_BOARDS: dict[str, type[Board]] = dict(zip(CORES, (MechanismBoard, MechanismBoardQ31), strict=True))


def verify_recording(
    target: str,
    rig: MechanismRig,
    recording: Recording,
    core: Core = "f32",
    progress: Callable[[int], None] | None = None,
    ranking: Sequence[Scored] = (),
    refined: bool = False,
) -> Verdict:
    """Plays it on a target, with the settings of `identify`; every hash is compared.

    Raises PvidError when the target cannot be started or refuses, or the identifier does not have what the model needs.

    Parameters
    ----------
    ranking : of the analysis of the recording, where there is one: the design is not searched for again
    refined : with the second stage, in float32
    """
    if refined:
        refuse_unrefined(core)
        board: Board = MechanismBoard.of_recording(rig, recording, True, ranking, refined=True)
    else:
        board = _BOARDS[core].of_recording(rig, recording, to_identify=True, ranking=ranking)
    samples = board.recording.T
    return verify(target, board.without_recording, Native(), *samples, progress=progress)
