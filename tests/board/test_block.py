"""Samples in blocks: the state behind a block is in every byte that behind the same samples one by one."""

from collections.abc import Callable
from itertools import cycle
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from mechanisms import board_of_mechanism, samples_in_si
from weak_rig import weak_rig, wild

from pvid.board.boards import BOARDS
from pvid.board.mechanism_board import MechanismBoard
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.refined_image import published_run
from pvid.codegen.weak_library import weak_native, weak_native_q31
from pvid.core.weak_native import RefinedIdentifier
from pvid.settings.enums import Reason
from pvid.twin.printed import PrintedTwin
from pvid.twin.printer.values import numbers

Samples = npt.NDArray[Any]

LENGTHS = ([1], [7], [24], [3, 0, 64, 1, 25, 199, 2, 24, 23])  # of blocks; the last: ragged ones
NEW = (Reason.UPDATED, Reason.MISFIT)
IDLE = (Reason.ACCUMULATED, Reason.WARMING_UP)
JUDGED = {*NEW, Reason.HELD_UNCERTAIN, Reason.HELD_SINGULAR}
KINDS = {"f32": MechanismBoard, "q31": MechanismBoardQ31}

# Samples that are signals; held ones; without an input; with an algebraic equation; many parameters.
NAMES = ("kapitza", "dc_motor", "free_pendulum", "heated_plate", "mass_chain")


def identifier_of(name: str, kind: str) -> tuple[Any, Samples]:
    """Of a board of the mechanism, with its recording."""
    board = board_of_mechanism(name, KINDS[kind])
    if isinstance(board, MechanismBoardQ31):
        return weak_native_q31(board.weak.made, board.weak.parameters, board.weak.config).identifier(), board.recording
    core = weak_native(board.compiled, board.config.design).identifier_of(board.config)
    return core, np.ascontiguousarray(samples_in_si(board), np.float32)


def reason_of(reasons: list[Reason]) -> Reason:
    """Of a block."""
    new = [one for one in reasons if one in NEW]
    return (new or [one for one in reasons if one not in IDLE] or reasons)[-1]


def states_of(core: Any) -> int:
    """All bytes of its objects in C memory."""
    objects = [core.state, *([core.refinement] if isinstance(core, RefinedIdentifier) else [])]
    return hash(b"".join(bytes(core.native.headers.ffi.buffer(one)) for one in objects))


def assert_same_in_blocks(core: Any, samples: Samples, *, held: bool = True) -> set[Reason]:
    """In blocks of LENGTHS: the state is that behind each tick one by one, the reason that of the last with a new
    estimate, or with something to report. held: with a gap behind a quarter, and frozen between a third and a half.

    Returns the reasons of the ticks.
    """
    step, block = (getattr(core.native.library, f"pvid_weak_{one}_{core.core}") for one in ("step", "step_block"))
    pointer, ticks = core.native.headers.pointer, len(samples)
    changes: dict[int, Callable[[], None]] = {}
    if held:
        changes = {ticks // 4: core.gap, ticks // 3: lambda: core.freeze(True), ticks // 2: lambda: core.freeze(False)}
    states, reasons = [], []
    for tick, sample in enumerate(samples):
        changes.get(tick, lambda: None)()
        reasons.append(Reason(step(core.state, pointer(sample))))
        states.append(states_of(core))
    for lengths in LENGTHS:
        core.initialise()
        tick, sizes = 0, cycle(lengths)
        while tick < ticks:
            changes.get(tick, lambda: None)()
            end = min(tick + next(sizes), *(one for one in (*changes, ticks) if one > tick))
            reason = Reason(block(core.state, pointer(samples[tick:end]), end - tick))
            if end > tick:
                assert states_of(core) == states[end - 1], f"{lengths}, after tick {end}"
                assert reason is reason_of(reasons[tick:end]), f"{lengths}, after tick {end}"
            tick = end
    return set(reasons)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", NAMES)
def test_a_block_leaves_the_state_of_its_samples_one_by_one(name: str, kind: str) -> None:
    core, samples = identifier_of(name, kind)
    reasons = assert_same_in_blocks(core, wild(np.tile(samples, (5, 1)), 2**20))
    assert reasons >= {Reason.ACCUMULATED, Reason.HELD_FROZEN} and reasons & JUDGED
    assert reasons & {Reason.REJECTED_NOT_FINITE, Reason.REJECTED_SATURATED}


@pytest.mark.parametrize("decimation", [1, 2, 3])
@pytest.mark.parametrize("name", ["kapitza", "dc_motor"])
def test_a_block_of_steps_of_few_ticks(name: str, decimation: int) -> None:
    rig = weak_rig(name)
    core: Any = rig.native.identifier_of(rig.resized(functions=6, hop=160, decimation=decimation))
    assert JUDGED & assert_same_in_blocks(core, rig.samples[:6000])


def test_a_block_of_both_stages() -> None:
    run = published_run("kapitza", 12_000, BOARDS["mps2-an386"])
    core: Any = run.native()
    assert JUDGED & assert_same_in_blocks(core, run.weak.samples, held=False)
    assert core.refined is not None


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["kapitza", "dc_motor"])
def test_the_twin_has_the_same_blocks(name: str, kind: str) -> None:
    core, samples = identifier_of(name, kind)
    samples = wild(samples, 2**20)
    twin = PrintedTwin(core.sources, core.native.config if kind == "q31" else core.config)
    module, flat = vars(twin.module), numbers(samples, 0 if kind == "q31" else np.float32(0))
    sizes, tick = cycle(LENGTHS[-1]), 0
    while tick < len(samples):
        end = min(tick + next(sizes), len(samples))
        given = core.native.headers.pointer(samples[tick:end])
        reason = getattr(core.native.library, f"pvid_weak_step_block_{kind}")(core.state, given, end - tick)
        part = flat[tick * samples.shape[1] : end * samples.shape[1]]
        assert module[f"pvid_weak_step_block_{kind}"](twin.state, part, end - tick) == reason
        estimator = core.native.headers.ffi.addressof(core.estimator)
        own = getattr(core.native.library, f"pvid_fnv_estimator_{kind}")(0, estimator, reason)
        assert module[f"pvid_fnv_estimator_{kind}"](0, twin.estimator, reason) == own, f"behind tick {end}"
        tick = end
    assert (core.counters, core.is_published) == (twin.counters, twin.is_published)
