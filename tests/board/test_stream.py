"""A run played over a serial link: the same bits whatever the line does, and an exact account of what it did."""

from __future__ import annotations

import json
import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from program import pvid

from pvid.base.errors import PvidError
from pvid.board.replay_image import SAMPLING, ReplayRun, native_hashes, standard_run
from pvid.board.stream_rig import StreamRig, played_samples, stream_rig
from pvid.board.target import HOST_TARGET, Playback, Target, judge, open_target, play, verify
from pvid.core.native import Native
from pvid.link.frames import Estimate, upper_triangle
from pvid.link.port import Port
from pvid.rig.file import RigFile
from pvid.settings.f32 import WeakConfig
from pvid.settings.q31 import WeakConfigQ31
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors

TICKS = 5000
LONG = 10_000
KINDS = (("weak", "f32"), ("weak", "q31"), ("strong", "f32"), ("strong", "q31"))
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
# Every form and core on the host, each in turn on two processors; test_targets.py proves the bits of all boards, and
# the long form streams to all of them.
SHORT = {*((HOST_TARGET, *kind) for kind in KINDS), *(("mps2-an386", *kind) for kind in KINDS[:2])}
SHORT |= {("virt-rv32imac", *kind) for kind in KINDS[2:]}
STREAMED = [
    pytest.param(name, *kind, marks=() if (name, *kind) in SHORT else pytest.mark.long)
    for name in (HOST_TARGET, *EMULATED)
    for kind in KINDS
]


@pytest.fixture(params=["weak", "strong"])
def form(request: pytest.FixtureRequest) -> str:
    return str(request.param)


def rig_of(run: ReplayRun) -> StreamRig:
    """What an image is made for that plays it."""
    return StreamRig(
        config=run.config,
        sample_rate=SAMPLING[run.form].rate,
        l1=STANDARD_PENDULUM.l1,
        phi_lsb=float(run.phi_lsb),
        y_lsb=float(run.y_lsb),
    )


def standard_rig(form: str, core: str = "f32") -> StreamRig:
    return rig_of(standard_run(form, TICKS, core))


def expected(form: str, native: Native, core: str = "f32") -> npt.NDArray[np.uint32]:
    return native_hashes(standard_run(form, TICKS, core), native)


def play_standard(
    target: Target,
    form: str,
    core: str = "f32",
    reopen: Callable[[], Target] | None = None,
    patience_s: float = 30.0,
) -> Playback:
    run = standard_run(form, TICKS, core)
    phi, y = run.samples
    return play(target, rig_of(run), phi, y, reopen=reopen, patience_s=patience_s, resend_s=0.5)


@pytest.mark.parametrize(("name", "form", "core"), STREAMED)
def test_every_target_computes_the_bits_of_the_host(name: str, form: str, core: str, native: Native) -> None:
    playback = play_standard(open_target(name, standard_rig(form, core)), form, core)
    verdict = judge(playback, expected(form, native, core))
    assert verdict.equal, verdict.text
    assert playback.missing_hashes == []
    assert (playback.done, playback.restarts) == (TICKS, 0)
    assert playback.hello is not None and name.endswith(playback.hello.board[:16])


@pytest.mark.long
@pytest.mark.parametrize(("form", "core"), KINDS)
def test_a_long_run_stays_equal_on_two_boards_at_once(form: str, core: str, native: Native) -> None:
    run = standard_run(form, LONG, core)
    phi, y = run.samples
    rig = rig_of(run)
    with ThreadPoolExecutor(2) as pool:
        verdicts = list(pool.map(lambda name: verify(name, rig, native, phi, y), ("mps2-an386", "virt-rv32imac")))
    for verdict in verdicts:
        assert verdict.equal, verdict.text
        assert verdict.playback.done == LONG and len(verdict.playback.hashes) == LONG // 500


def test_the_last_estimate_is_that_of_the_core(native: Native) -> None:
    run = standard_run("weak", TICKS)
    assert isinstance(run.config, WeakConfig)
    identifier = native.identifier(run.config)
    identifier.run(run.phi, run.y)
    last = identifier.assess()
    estimate = play_standard(open_target(HOST_TARGET, rig_of(run)), "weak").estimates[TICKS]
    assert isinstance(estimate, Estimate)
    assert np.array_equal(np.array(estimate.p[:6], np.float32), last["p"])
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
def test_a_line_that_spoils_bytes_changes_no_bit(form: str, seed: int, native: Native) -> None:
    random = np.random.default_rng(seed)
    target = open_target(HOST_TARGET, standard_rig(form), lambda port: Faulty(port, 1e-4, random))
    playback = play_standard(target, form)
    verdict = judge(playback, expected(form, native))
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
def test_a_killed_emulator_is_started_again_and_the_run_over(name: str, form: str, native: Native) -> None:
    rig = standard_rig(form)
    playback = play_standard(
        start_to_be_killed(name, form, 20_000), form, reopen=lambda: open_target(name, rig), patience_s=10
    )
    verdict = judge(playback, expected(form, native))
    assert verdict.equal, verdict.text
    assert playback.restarts == 1


def test_lost_port_ends_with_the_missing_samples(native: Native) -> None:
    target = start_to_be_killed(HOST_TARGET, "weak", 20_000)  # built first
    began = time.monotonic()
    playback = play_standard(target, "weak", patience_s=3)
    assert time.monotonic() - began < 20
    verdict = judge(playback, expected("weak", native))
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


def test_a_silent_port_ends_in_bounded_time(silent_port: str, native: Native) -> None:
    began = time.monotonic()
    playback = play_standard(open_target(silent_port, standard_rig("weak")), "weak", patience_s=2)
    assert time.monotonic() - began < 10
    assert not judge(playback, expected("weak", native)).equal
    assert "no answer for 2 s" in playback.account


def test_an_image_for_other_settings_is_refused() -> None:
    run, rig = standard_run("weak", TICKS), standard_rig("weak")
    with pytest.raises(PvidError, match="made for other settings"):
        play(open_target(HOST_TARGET, rig), replace(rig, l1=0.31), run.phi, run.y)


def test_an_image_with_the_other_core_is_refused() -> None:
    run = standard_run("weak", TICKS)
    with pytest.raises(PvidError, match="the other form or the other core"):
        play(open_target(HOST_TARGET, standard_rig("weak", "q31")), standard_rig("weak"), run.phi, run.y)


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
    run, rig = standard_run("weak", TICKS), standard_rig("weak")
    assert isinstance(rig.config, WeakConfig)
    bad = replace(rig, config=replace(rig.config, estimator=replace(rig.config.estimator, **{field: value})))
    name = {"upper": "bounds", "forgetting_s": "forgetting", "feedback_hz": "feedback"}.get(field, field)
    with pytest.raises(PvidError, match=f"bad {name.replace('_', ' ')}"):
        play(open_target(HOST_TARGET, bad), bad, run.phi, run.y)


def test_a_wrong_bit_is_not_called_equal(native: Native) -> None:
    run = standard_run("weak", TICKS)
    phi = run.phi.copy()
    phi[2600] += run.phi_lsb  # one step of the encoder, once
    playback = play(open_target(HOST_TARGET, rig_of(run)), rig_of(run), phi, run.y)
    verdict = judge(playback, expected("weak", native))
    assert not verdict.equal
    assert verdict.first is not None and 2500 <= verdict.first[0] < verdict.first[1]


def test_an_unknown_target_is_named() -> None:
    with pytest.raises(PvidError, match="there is no target mps2; there are stream-host, microbit"):
        open_target("mps2", standard_rig("weak"))
    with pytest.raises(PvidError, match="there is no port /dev/nowhere"):
        open_target("/dev/nowhere", standard_rig("weak"))


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_an_image_has_room_for_a_design_beyond_the_default_bounds(native: Native, core: str) -> None:
    """5 kHz: longer filters and a larger decimation than pvid/config.h holds by default."""
    rate, ticks = 5000.0, 600
    run = simulate(sensors=standard_sensors(14), sample_rate=rate, duration=ticks / rate, seed=1).run
    rig = replace(RigFile.standard(), identifier=replace(RigFile.standard().identifier, core=core))  # type: ignore[arg-type]
    made_for = stream_rig(rig, rate)
    config = made_for.config
    assert isinstance(config, WeakConfig | WeakConfigQ31)
    assert config.design.taps > 81 and config.design.decimation > 32
    verdict = verify(HOST_TARGET, made_for, native, *played_samples(rig, run))
    assert verdict.equal and verdict.playback.done == ticks


def test_identify_and_compare_on_targets(tmp_path: Path) -> None:
    assert pvid(tmp_path, "simulate", "run.csv", "--duration", "6", "--truth", "linear").returncode == 0
    done = pvid(tmp_path, "identify", "run.csv", "--rig", "run.toml", "--on", "mps2-an386", "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["on"] == "mps2-an386"
    both = pvid(
        tmp_path,
        "compare",
        "run.csv",
        "--rig",
        "run.toml",
        "--core",
        "all",
        "--on",
        HOST_TARGET,
    )
    assert both.returncode == 0, both.stderr
    assert both.stdout.count("equal") == 8 and "DIFFERENT" not in both.stdout
    assert pvid(tmp_path, "identify", "run.csv", "--rig", "run.toml", "--on", "nowhere").returncode == 2
