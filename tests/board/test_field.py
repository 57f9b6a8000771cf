"""Field mode: a board that samples by itself; its samples from the sensor's twin, its bits from the host's core."""

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import field_board
import numpy as np
import numpy.typing as npt
import pytest
from processes import PATIENCE_S
from test_stream import KINDS, SHORT

from pvid.base.errors import PvidError
from pvid.board.field import FieldRecord, collect
from pvid.board.mechanism_board import MechanismBoard, board_of_guess
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.stream_image import settings_number
from pvid.board.strong_board import StrongBoard
from pvid.board.target import HOST_TARGET, Target, open_target
from pvid.codegen.weak_library import weak_native
from pvid.configuration.nominal_run import nominal_run
from pvid.core.native import Native
from pvid.link.frames import SCHEMA_TEXT, Core, Source, encode
from pvid.link.port import Port

TICKS = 9000  # two announcements more in the weak form's 1 kHz
Simulated = MechanismBoard | MechanismBoardQ31 | StrongBoard


@cache
def standard_rig(form: str, core: str = "f32") -> Simulated:
    """Of a board that reads a simulation of a rig's guess."""
    if form == "strong":
        return StrongBoard.of_guess(field_board.rig())
    board = board_of_guess(field_board.rig(), core)
    return replace(board, recording=board.recording[:TICKS])  # type: ignore[arg-type]


def sensed(rig: Simulated) -> tuple[npt.NDArray[Any], ...]:
    """The samples as the identifier takes them, in its order."""
    return tuple(rig.recording.T)


def expected(rig: Simulated, first: int, last: int) -> tuple[npt.NDArray[Any], ...]:
    """Those of some ticks."""
    return tuple(one[first:last] for one in sensed(rig))


@pytest.fixture
def host_target() -> Iterator[Target]:
    with open_target(HOST_TARGET, standard_rig("weak")) as target:
        yield target


def assert_replays(record: FieldRecord, rig: Simulated, native: Native) -> None:
    """The samples are the twin's, the hashes and estimates those of the host's core on them."""
    samples = record.samples(0, record.ticks)
    right = expected(rig, 0, record.ticks)
    assert all(np.array_equal(a, b) for a, b in zip(samples, right, strict=True))
    hashes = rig.hashes(native, *samples)
    assert len(record.hashes) >= record.ticks // 500 - 1
    assert all(hashes[tick - 1] == value for tick, value in record.hashes.items())


@pytest.mark.parametrize(
    ("name", "form", "core"),
    [
        pytest.param(name, *kind, marks=() if (name, *kind) in SHORT else pytest.mark.long)
        for name in (HOST_TARGET, "microbit", "mps2-an386", "virt-rv32imac")
        for kind in KINDS
    ],
)
def test_a_board_samples_by_itself(name: str, form: str, core: str, native: Native) -> None:
    rig = standard_rig(form, core)
    ticks = 5000 if form == "weak" else 1000
    with open_target(name, rig) as target:
        record = collect(target, ticks, begin=rig)
    assert record.gaps == [] and record.received.missing == 0 and record.first == 0
    assert_replays(record, rig, native)
    assert record.schema == SCHEMA_TEXT
    assert record.configuration is not None and record.configuration.settings == settings_number(rig)
    assert record.hello is not None and record.status is not None
    assert (record.hello.sample_rate, Core(record.hello.core).name) == (rig.sample_rate, core.upper())
    assert record.hello.form_name == form
    assert sorted(record.estimates) == list(range(500, max(record.estimates) + 1, 500))


def test_the_last_estimate_comes_with_the_bits_of_the_core(host_target: Target) -> None:
    board = standard_rig("weak")
    assert isinstance(board, MechanismBoard)
    record = collect(host_target, TICKS, begin=board)
    tick = max(record.estimates)
    identifier = weak_native(board.compiled, board.config.design).identifier_of(board.config)
    identifier.run_samples(board.readings(*record.samples(0, tick)))
    last, estimate = identifier.published, record.estimates[tick]
    assert last is not None
    assert np.array_equal(np.array(estimate.p[: len(last["p"])], np.float32), last["p"])
    truth = np.array([one.guess for one in board.compiled.unknowns])
    assert np.abs(last["p"][:3] / truth[:3] - 1).max() < 0.02  # the simulated rig is that of the guess


def test_late_client_receives_the_current_state(host_target: Target, native: Native) -> None:
    rig = standard_rig("weak")
    assert collect(host_target, 600, begin=rig).first == 0
    late = collect(host_target, 5000)  # 4 s of the board's time hold an announcement
    assert late.first >= 600
    assert late.hello is not None and late.schema == SCHEMA_TEXT and late.configuration is not None
    assert late.hello.session == late.configuration.session
    assert np.array_equal(late.samples(late.first, late.ticks), expected(rig, late.first, late.ticks))


def test_in_time_a_sample_takes_its_time(host_target: Target, native: Native) -> None:
    rig = standard_rig("weak")
    collect(host_target, 100, begin=rig, source=Source.SENSOR)
    began = time.monotonic()
    record = collect(host_target, 2000)
    assert 1.5 < time.monotonic() - began < PATIENCE_S  # 2000 samples at 1 kHz; late on a busy machine, never early
    assert record.gaps == []


@dataclass
class Dropping:
    """A line that loses a piece of what comes, once."""

    port: Port
    begin: int
    end: int
    at: int = 0

    def read(self, size: int = 1, /) -> bytes:
        data = self.port.read(size)
        kept = bytes(b for i, b in enumerate(data, self.at) if not self.begin <= i < self.end)
        self.at += len(data)
        return kept

    def write(self, data: bytes, /) -> int | None:
        return self.port.write(data)

    def close(self) -> None:
        self.port.close()


def test_losses_of_the_line_are_named(native: Native) -> None:
    rig = standard_rig("weak")
    with open_target(HOST_TARGET, rig, lambda port: Dropping(port, 20_000, 21_000)) as target:
        record = collect(target, 5000, begin=rig)
    assert record.received.missing >= 3
    (gap,) = record.gaps
    assert 64 <= gap[1] - gap[0] <= 160
    with pytest.raises(PvidError, match=f"ticks {gap[0]} to {gap[1] - 1} are missing"):
        record.samples(0, record.ticks)
    after = expected(rig, gap[1], record.ticks)
    assert np.array_equal(record.samples(gap[1], record.ticks), after)  # what came after it is good


def test_an_unknown_source_is_refused(host_target: Target) -> None:
    rig = standard_rig("weak")
    with pytest.raises(PvidError, match="the source of samples is unknown to it"):
        collect(host_target, 100, begin=rig, source=7)  # type: ignore[arg-type]


def test_samples_from_the_pc_are_not_mixed_in(host_target: Target, native: Native) -> None:
    rig = standard_rig("weak")
    collect(host_target, 100, begin=rig)
    host_target.port.write(encode(rig.frame(np.ones((64, 2), np.float32)), 9, tick=0))
    record = collect(host_target, 3000)
    assert np.array_equal(record.samples(record.first, record.ticks), expected(rig, record.first, record.ticks))


def test_sensors_read_a_recording_over_and_over_where_it_is_wanted() -> None:
    board = standard_rig("weak")
    assert isinstance(board, MechanismBoard)
    board = replace(board, recording=board.recording[:700], repeats=True)
    with open_target(HOST_TARGET, board) as target:
        record = collect(target, 2000, begin=board)
    assert np.array_equal(np.stack(record.samples(0, 2000), axis=1), np.tile(board.recording, (3, 1))[:2000])


def test_errors_of_a_board_without_a_recording_contain_what_small_angles_neglect() -> None:
    """The square of the largest angle of the guess, as of a recorded one, and gains besides."""
    made = nominal_run(field_board.rig())
    phi = np.asarray(made.recording.signals["phi"])
    part = float(np.max(np.abs(phi - phi.mean()))) ** 2
    assert 1e-3 < part < 0.1
    shared = MechanismBoard.of_guess(field_board.rig()).config.trust.shared
    assert shared is not None and part < shared[0] < np.hypot(part, 0.01)
    fixed = MechanismBoardQ31.of_guess(field_board.rig()).config.trust.shared
    assert fixed is not None and fixed[0] / 2**24 == pytest.approx(shared[0], abs=2**-25)
