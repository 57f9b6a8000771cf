"""A board in the field, played by the C core on this machine: what it would send, and the same on a pseudo-terminal."""

from __future__ import annotations

import itertools
import os
import signal
import time
import tty
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
from lying_board import estimate_of
from pendulum_plant import simulate, standard_sensors
from pendulum_run import Run
from processes import until

from pvid.base.toml_text import toml_document
from pvid.board.mechanism_board import MechanismBoard
from pvid.board.stream_image import settings_number
from pvid.codegen.weak_library import weak_native
from pvid.link import frames as link
from pvid.log.mechanism import LogMechanism
from pvid.log.rig import mechanism_in
from pvid.rig.mechanism_file import MechanismRig
from pvid.settings.enums import Reason
from pvid.twin import fnv

SAMPLES_A_FRAME = 16


@dataclass(frozen=True)
class Field:
    """A board's run: an estimate and a hash every so many ticks, who it is every `hello_every`; ticks count from
    `first_tick`, a multiple of the others."""

    ticks: int
    seed: int = 1
    estimate_every: int = 160  # multiples of SAMPLES_A_FRAME
    hash_every: int = 160
    hello_every: int = 2000
    first_tick: int = 0

    @property
    def run(self) -> Run:
        """What its sensors read: the standard rig, 14 bits."""
        duration = self.ticks / 1000
        return simulate(sensors=standard_sensors(14), truth="linear", duration=duration, seed=self.seed).run


def rig(l1: float = 0.3) -> MechanismRig:
    """The rig that goes with it."""
    sensors = standard_sensors(14)
    return MechanismRig(
        "kapitza",
        1000.0,
        known={"l1": l1},
        sensor={
            "phi": {"resolution": sensors.phi_lsb, "reach": 0.5},
            "y": {"resolution": sensors.y_lsb, "gain_sd": 0.0},
        },
        nominal={"g": 9.8, "l2": 0.1, "rho2": 0.1},
        known_sd={"l1": 0.0},
    )


@cache
def board() -> MechanismBoard:
    """The board for it, with the weak identifier."""
    return MechanismBoard.of_guess(rig())


@cache
def text() -> str:
    """Of its log."""
    return board().text()


@cache
def mechanism() -> LogMechanism:
    """Of its log."""
    found = mechanism_in(toml_document(text()))
    assert found is not None
    return found


@cache
def _settings() -> int:
    return settings_number(board())


def hello(session: int = 7, **values: Any) -> link.Hello:
    """Who it is."""
    sensors, n_p = standard_sensors(14), len(board().p_names)
    said: dict[str, Any] = {
        "form": int(link.Form.WEAK),
        "core": int(link.Core.F32),
        "n_p": n_p,
        "window": 256,
        "settings": _settings(),
        "session": session,
        "sample_rate": board().sample_rate,
        "phi_lsb": sensors.phi_lsb,
        "y_lsb": sensors.y_lsb,
        "p_unit": (*[1.0] * n_p, *[0.0] * (link.PLACES - n_p)),
        "board": "field",
    }
    return link.Hello(**{**said, **values})


def messages(field: Field, session: int = 7) -> Iterator[tuple[int, link.Message]]:
    """(tick, message) in the order in which a board sends them."""
    run, own = field.run, board()
    settings = _settings()
    configure = own.configure(settings, field.hash_every, field.estimate_every, first_tick=field.first_tick)
    configure = replace(configure, session=session)
    identifier = weak_native(own.compiled, own.config.design).identifier_of(own.config)
    samples = own.readings(run.y[: field.ticks], run.phi[: field.ticks])
    verdict = int(Reason.WARMING_UP)
    sample_hash = fnv.START
    for first in range(0, field.ticks, SAMPLES_A_FRAME):
        at = field.first_tick + first
        if first % field.hello_every < SAMPLES_A_FRAME:
            yield at, hello(session)
            yield at, link.Schema(link.SCHEMA_TEXT.encode())
            yield at, link.Names(own.names.text.encode())
            yield at, configure
            yield at, link.Status(session, link.Code.RUNNING, 0, identifier.counters["updates"], *[0] * 7)
        last = min(first + SAMPLES_A_FRAME, field.ticks)
        raw = replace(link.Raw.of_values(*samples[first:last].T), session=session)
        sample_hash = fnv.fold_bytes(sample_hash, raw.data)
        yield at, raw
        reports = [every for every in (field.estimate_every, field.hash_every) if every]
        ends = {tick for tick in range(first + 1, last) if any(tick % every == 0 for every in reports)}
        for begun, end in itertools.pairwise(sorted({first, *ends, last})):
            reasons = identifier.run_samples(samples[begun:end], sums=False).reason
            verdict = next((int(one) for one in reasons[::-1] if one != Reason.ACCUMULATED), verdict)
            done = field.first_tick + end
            if field.estimate_every and end % field.estimate_every == 0:
                updates = identifier.counters["updates"]
                given = {"session": session, "updates": updates, "reason": verdict}
                yield done, estimate_of(identifier.estimate, link.Estimate, **given)
            if field.hash_every and end % field.hash_every == 0:
                yield done, link.Hash(session, hash=identifier.running_hash, sample_hash=sample_hash)


def in_time(sent: Iterable[tuple[int, link.Message]], per_second: int) -> Iterator[tuple[int, link.Message]]:
    """The same, so many ticks a second; 0: at once."""
    began = time.monotonic()
    for tick, message in sent:
        if per_second and (ahead := began + tick / per_second - time.monotonic()) > 0:
            time.sleep(ahead)
        yield tick, message


def frames(sent: Iterable[tuple[int, link.Message]], first_sequence: int = 0) -> Iterator[bytes]:
    """Encoded."""
    for sequence, (tick, message) in zip(itertools.count(first_sequence), sent):  # noqa: B905
        yield link.encode(message, sequence, tick)


def cheap_frames(count: int) -> Iterator[bytes]:
    """`count` frames of samples that cost next to nothing to make, for measurements."""
    payload = link.Raw.of_values(np.zeros(SAMPLES_A_FRAME), np.zeros(SAMPLES_A_FRAME)).payload
    for sequence in range(count):
        yield link.encode_raw(link.Raw.TYPE, sequence, SAMPLES_A_FRAME * sequence, payload)


class PtyLine:
    """A pseudo-terminal with a symbolic link to its other end, as a serial adapter would have a fixed name."""

    def __init__(self, place: Path) -> None:
        self.ours, theirs = os.openpty()
        tty.setraw(theirs)
        fresh = place.with_name(place.name + ".new")
        fresh.symlink_to(os.ttyname(theirs))
        fresh.replace(place)
        self._theirs = theirs  # kept open: without it writing fails while nobody listens

    def await_word(self) -> None:
        """Until the other end has sent something: what was written before it opened is thrown away when it does."""
        os.read(self.ours, 4096)

    def write(self, data: bytes) -> None:
        """All of it, however slowly it is read."""
        while data:
            data = data[os.write(self.ours, data) :]


@cache
def sent_by(field: Field) -> list[tuple[int, link.Message]]:
    """All that a board sends in a run, computed before anybody waits."""
    return list(messages(field))


def _serve(place: Path, sent: list[tuple[int, link.Message]], per_second: int) -> None:
    line = PtyLine(place)
    line.await_word()
    for frame in frames(in_time(sent, per_second)):
        line.write(frame)
    signal.pause()  # what was sent and not yet read is lost with this process


class Board:
    """A board behind a symbolic link, in a fork of this process; `per_second`: ticks, 0: at once."""

    def __init__(
        self, place: Path, ticks: int, *, seed: int = 1, estimate_every: int = 500, per_second: int = 0
    ) -> None:
        self._place = place
        given = place, sent_by(Field(ticks, seed, estimate_every)), per_second
        self._process = get_context("fork").Process(target=_serve, args=given, daemon=True)
        self._process.start()
        until(place.exists)

    def kill(self) -> None:
        """The board is gone, with its line."""
        self._place.unlink(missing_ok=True)  # the terminal's name may soon be that of somebody else's
        self._process.kill()
        self._process.join()
