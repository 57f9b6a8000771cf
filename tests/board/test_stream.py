"""A run played over a serial link: the same bits whatever the line does, and an exact account of what it did."""

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from processes import PATIENCE_S

from pvid.base.errors import PvidError
from pvid.board import mechanism_image, mechanism_image_q31
from pvid.board.mechanism_board import MechanismBoard
from pvid.board.mechanism_board_q31 import MechanismBoardQ31
from pvid.board.mechanism_image import mechanism_run
from pvid.board.mechanism_image_q31 import fixed_run
from pvid.board.strong_board import StrongBoard
from pvid.board.target import HOST_TARGET, Playback, Target, judge, open_target, play, verify
from pvid.codegen.weak_library import weak_native
from pvid.core.native import Native
from pvid.link.frames import Estimate, upper_triangle
from pvid.link.port import Port
from pvid.models.simulated_rig import simulated_rig
from pvid.rig.mechanism_file import MechanismRig

TICKS = 5000
LONG = 10_000
KINDS = (("weak", "f32"), ("weak", "q31"), ("strong", "f32"))
EMULATED = (
    "microbit",
    "mps2-an385",
    "mps2-an386",
    "netduinoplus2",
    "mps2-an500",
    "mps2-an505",
    "mps3-an547",
    "virt-rv32imac",
    "virt-rv32imafc",
)
# Every form and core on the host, each core on a board; test_targets.py proves the bits of all boards, and the long
# form streams to all of them.
SHORT = {*((HOST_TARGET, *kind) for kind in KINDS), ("mps2-an386", "weak", "f32"), ("virt-rv32imac", "weak", "q31")}
STREAMED = [
    pytest.param(name, *kind, marks=() if (name, *kind) in SHORT else pytest.mark.long)
    for name in (HOST_TARGET, *EMULATED)
    for kind in KINDS
]


@pytest.fixture(params=["weak", "strong"])
def form(request: pytest.FixtureRequest) -> str:
    return str(request.param)


Played = MechanismBoard | MechanismBoardQ31 | StrongBoard


@dataclass(frozen=True)
class Standard:
    """A run of TICKS, what an image is made for that plays it, its signals and the hashes of the core here."""

    rig: Played
    signals: tuple[npt.NDArray[Any], ...]
    hashes: npt.NDArray[np.uint32]


@cache
def standard(form: str, core: str = "f32") -> Standard:
    if form == "strong":
        strong = StrongBoard.of_shipped_rig("kapitza")
        signals = tuple(strong.recording[:TICKS].T)
        return Standard(strong.without_recording, signals, strong.hashes(Native(), *signals))
    rig = MechanismRig("kapitza", known=simulated_rig("kapitza").knowns)
    if core == "q31":
        fixed = fixed_run("kapitza", TICKS)
        board = MechanismBoardQ31(rig, fixed.weak, fixed.counts).without_recording
        return Standard(board, tuple(fixed.counts.T), mechanism_image_q31.native_hashes(fixed))
    made = mechanism_run("kapitza", TICKS)
    own = MechanismBoard(rig, made.compiled, made.config, made.samples).without_recording
    return Standard(own, tuple(made.samples.T), mechanism_image.native_hashes(made))


def standard_rig(form: str, core: str = "f32") -> Played:
    return standard(form, core).rig


def expected(form: str, core: str = "f32") -> npt.NDArray[np.uint32]:
    return standard(form, core).hashes


def weak_board() -> MechanismBoard:
    board = standard("weak").rig
    assert isinstance(board, MechanismBoard)
    return board


def play_standard(
    target: Target, form: str, core: str = "f32", reopen: Callable[[], Target] | None = None, patience_s: float = 30.0
) -> Playback:
    run = standard(form, core)
    return play(target, run.rig, *run.signals, reopen=reopen, patience_s=patience_s, resend_s=0.5)


@pytest.mark.parametrize(("name", "form", "core"), STREAMED)
def test_every_target_computes_the_bits_of_the_host(name: str, form: str, core: str) -> None:
    playback = play_standard(open_target(name, standard_rig(form, core)), form, core)
    verdict = judge(playback, expected(form, core))
    assert verdict.equal, verdict.text
    assert playback.missing_hashes == []
    assert (playback.done, playback.restarts) == (TICKS, 0)
    assert playback.hello is not None and name.endswith(playback.hello.board[:16])


@pytest.mark.long
def test_a_long_run_stays_equal_on_two_boards_at_once(native: Native) -> None:
    rig = StrongBoard.of_shipped_rig("kapitza")
    y, phi = rig.recording[:LONG].T
    with ThreadPoolExecutor(2) as pool:
        verdicts = list(pool.map(lambda name: verify(name, rig, native, y, phi), ("mps2-an386", "virt-rv32imac")))
    for verdict in verdicts:
        assert verdict.equal, verdict.text
        assert verdict.playback.done == LONG and len(verdict.playback.hashes) == LONG // 500


def test_the_last_estimate_is_the_published_one_of_the_core() -> None:
    board, signals = weak_board(), standard("weak").signals
    identifier = weak_native(board.compiled, board.config.design).identifier_of(board.config)
    identifier.run_samples(np.stack(signals, axis=1))
    last = identifier.published
    assert last is not None
    estimate = play_standard(open_target(HOST_TARGET, board), "weak").estimates[TICKS]
    assert isinstance(estimate, Estimate)
    assert np.array_equal(np.array(estimate.p[:4], np.float32), last["p"][:4])
    assert estimate.covariance == upper_triangle(last["covariance"])


@dataclass
class Faulty:
    """A line that drops, flips and inserts bytes, each with this probability, in both directions."""

    port: Port
    rate: float
    random: np.random.Generator

    def _spoil(self, data: bytes) -> bytes:
        out = bytearray()
        for byte, draw in zip(data, self.random.random(len(data)), strict=True):
            if draw < self.rate:
                continue
            if draw < 2 * self.rate:
                byte ^= 1 << int(self.random.integers(0, 8))
            out.append(byte)
            if 2 * self.rate <= draw < 3 * self.rate:
                out.append(int(self.random.integers(0, 256)))
        return bytes(out)

    def read(self, size: int = 1, /) -> bytes:
        return self._spoil(self.port.read(size))

    def write(self, data: bytes, /) -> int | None:
        return self.port.write(self._spoil(data))

    def close(self) -> None:
        self.port.close()


@pytest.mark.parametrize("seed", range(3))
def test_a_line_that_spoils_bytes_changes_no_bit(form: str, seed: int) -> None:
    random = np.random.default_rng(seed)
    target = open_target(HOST_TARGET, standard_rig(form), lambda port: Faulty(port, 1e-4, random))
    playback = play_standard(target, form)
    verdict = judge(playback, expected(form))
    assert verdict.equal, verdict.text
    assert playback.board is not None
    damage = playback.received.damaged + playback.board.malformed + playback.board.bad_crc
    assert damage + playback.received.missing + playback.board.missing > 0  # the injector was there
    assert playback.sent == TICKS + playback.repeated


class KilledMidway:
    """Ends the process behind a target once so many bytes were written to it."""

    def __init__(self, port: Port, after: int, kill: Callable[[], None]) -> None:
        self.port, self.left, self.kill = port, after, kill

    def read(self, size: int = 1, /) -> bytes:
        return self.port.read(size)

    def write(self, data: bytes, /) -> int | None:
        self.left -= len(data)
        if self.left < 0:
            self.kill()
        return self.port.write(data)

    def close(self) -> None:
        self.port.close()


def start_to_be_killed(name: str, form: str, after: int) -> Target:
    target = open_target(name, standard_rig(form))

    def kill() -> None:
        assert target.process is not None
        target.process.kill()
        target.process.wait()

    target.port = KilledMidway(target.port, after, kill)
    return target


@pytest.mark.parametrize("name", [HOST_TARGET, "mps2-an386"])
def test_a_killed_emulator_is_started_again_and_the_run_over(name: str, form: str) -> None:
    rig = standard_rig(form)
    playback = play_standard(
        start_to_be_killed(name, form, 20_000), form, reopen=lambda: open_target(name, rig), patience_s=60
    )
    verdict = judge(playback, expected(form))
    assert verdict.equal, verdict.text
    assert playback.restarts == 1


def test_lost_port_ends_with_the_missing_samples() -> None:
    target = start_to_be_killed(HOST_TARGET, "weak", 20_000)  # built first
    began = time.monotonic()
    playback = play_standard(target, "weak", patience_s=3)
    assert time.monotonic() - began < PATIENCE_S
    verdict = judge(playback, expected("weak"))
    assert not verdict.equal
    assert not playback.complete
    assert 0 < playback.done < TICKS
    assert f"{playback.done} of {TICKS} samples" in verdict.text


@pytest.fixture
def silent_port() -> Iterator[str]:
    """A pseudo-terminal on which nobody answers."""
    ours, theirs = os.openpty()
    yield os.ttyname(theirs)
    os.close(ours)
    os.close(theirs)


def test_a_silent_port_ends_in_bounded_time(silent_port: str) -> None:
    began = time.monotonic()
    playback = play_standard(open_target(silent_port, standard_rig("weak")), "weak", patience_s=2)
    assert time.monotonic() - began < PATIENCE_S
    assert not judge(playback, expected("weak")).equal
    assert "no answer for 2 s" in playback.account


def test_an_image_for_other_settings_is_refused() -> None:
    board = weak_board()
    other = replace(board, config=replace(board.config, iterations=1))
    with pytest.raises(PvidError, match="made for other settings"):
        play(open_target(HOST_TARGET, board), other, *standard("weak").signals)


def test_an_image_with_the_other_core_is_refused() -> None:
    with pytest.raises(PvidError, match="the other form or the other core"):
        play(open_target(HOST_TARGET, standard_rig("weak", "q31")), standard_rig("weak"), *standard("weak").signals)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("start", np.full(4, np.nan, np.float32)),
        ("start_sd", np.zeros(4, np.float32)),
        ("upper", np.full(4, np.inf, np.float32)),
        ("row_sd", -1.0),
        ("forgetting_s", -1.0),
        ("feedback_hz", float("nan")),
        ("law", 2),
        ("divider", 0),
    ],
)
def test_refusal_of_the_core_is_named(field: str, value: Any) -> None:
    """Every setting that goes over the link."""
    board = weak_board()
    bad = replace(board, config=replace(board.config, estimator=replace(board.config.estimator, **{field: value})))
    name = {"upper": "bounds", "forgetting_s": "forgetting", "feedback_hz": "feedback"}.get(field, field)
    with pytest.raises(PvidError, match=f"bad {name.replace('_', ' ')}"):
        play(open_target(HOST_TARGET, bad), bad, *standard("weak").signals)


def test_a_wrong_bit_is_not_called_equal() -> None:
    y, phi = standard("weak").signals
    phi = phi.copy()
    phi[2600] += np.float32(2 * np.pi / 2**14)  # one step of the encoder, once
    playback = play(open_target(HOST_TARGET, weak_board()), weak_board(), y, phi)
    verdict = judge(playback, expected("weak"))
    assert not verdict.equal
    assert verdict.first is not None and 2500 <= verdict.first[0] < verdict.first[1]


def test_an_unknown_target_is_named() -> None:
    with pytest.raises(PvidError, match="there is no target mps2; there are stream-host, microbit"):
        open_target("mps2", standard_rig("weak"))
    with pytest.raises(PvidError, match="there is no port /dev/nowhere"):
        open_target("/dev/nowhere", standard_rig("weak"))
