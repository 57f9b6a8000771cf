"""Saved and restored identifiers of the strong form continue bit for bit; a configuration that differs in any field is
refused. The weak form: test_snapshot_weak.py."""

from __future__ import annotations

import zlib
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from configurations import subjects
from hypothesis import given
from hypothesis import strategies as st

from pvid.cases import CASES
from pvid.core import snapshot
from pvid.core.native import Identifier, Native
from pvid.rig.file import RigFile
from pvid.settings.enums import SnapshotStatus, Status
from pvid.sim.pendulum import Simulation

TICKS = 4000
RIG = RigFile.standard()
# Before anything, in the first window, later, at the end.
PLACES = (0, 1, 777, 1290, 2345, TICKS - 1)

Samples = npt.NDArray[Any]


def rig_with(**settings: Any) -> RigFile:
    return replace(RIG, identifier=replace(RIG.identifier, **settings))


MADE: dict[str, tuple[str, dict[str, Any]]] = {
    "strong": ("f32", {"form": "strong", "forgetting_s": 3.0}),
    "strong q31": ("q31", {"form": "strong", "forgetting_s": 3.0, "outlier_gate": 6.0}),
    "savitzky-golay": ("f32", {"form": "strong", "differentiator": "savitzky-golay"}),
}
BOTH = tuple(MADE)[:2]  # cores


def made(native: Native, name: str) -> Identifier:
    """A fresh identifier of MADE."""
    core, settings = MADE[name]
    rig = rig_with(**settings)
    return native.identifier(CASES[rig.identifier.form, core].settings(rig, 1000.0))


def samples_for(name: str, simulation: Simulation) -> tuple[Samples, Samples]:
    phi, y = CASES["strong", MADE[name][0]].samples(RIG, simulation.run)
    return phi[:TICKS], y[:TICKS]


@pytest.mark.parametrize("name", MADE)
def test_a_restored_run_continues_bit_for_bit(name: str, native: Native, standard_20_bits: Simulation) -> None:
    phi, y = samples_for(name, standard_20_bits)
    whole = made(native, name)
    uninterrupted = whole.run(phi, y, sums=False)
    for place in PLACES:
        first, second = made(native, name), made(native, name)
        record = first.run(phi[:place], y[:place], sums=False)
        assert snapshot.restore(second, snapshot.save(first)) is SnapshotStatus.RESTORED
        second.running_hash = first.running_hash  # the hash is kept beside the identifier, not in it
        rest = second.run(phi[place:], y[place:], sums=False)
        assert second.running_hash == whole.running_hash, place
        assert np.array_equal(np.concatenate([record.p, rest.p]), uninterrupted.p), place
        assert np.array_equal(np.concatenate([record.reason, rest.reason]), uninterrupted.reason), place
        assert second.counters == whole.counters
        assert snapshot.save(second) == snapshot.save(whole)


def test_every_build_of_a_machine_restores_what_another_saved(
    matrix: dict[str, Native], standard_20_bits: Simulation
) -> None:
    for name in BOTH:
        images = set()
        for native in matrix.values():
            identifier = made(native, name)
            phi, y = samples_for(name, standard_20_bits)
            identifier.run(phi[:3000], y[:3000], sums=False)
            images.add(snapshot.save(identifier))
        for native in matrix.values():
            for image in images:
                assert snapshot.restore(made(native, name), image) is SnapshotStatus.RESTORED


@pytest.mark.parametrize("name", BOTH)
def test_another_form_or_core_is_refused(name: str, native: Native) -> None:
    for other in BOTH:
        status = SnapshotStatus.RESTORED if other == name else SnapshotStatus.OTHER_KIND
        assert snapshot.restore(made(native, name), snapshot.save(made(native, other))) is status


def changed(value: Any) -> Any:
    """Another value; a size gets smaller, so that no table is read beyond its end."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, float):
        return 1.5 * value + 0.25
    return value - 1 if value > 0 else value + 1


@pytest.mark.parametrize("name", BOTH)
def test_every_setting_that_differs_is_seen_and_no_other(name: str, native: Native) -> None:
    subject = subjects(native)[name]
    identifier = subject.identifier
    assert isinstance(identifier, Identifier)
    image, before = snapshot.save(identifier), identifier.state_bytes
    for field in subject.fields.values():
        if field.kind.kind != "pointer":
            kept = field.value
            field.set(changed(kept))
            seen = snapshot.restore(identifier, image) is SnapshotStatus.OTHER_CONFIG
            assert seen == subject.is_used(field), field.name
            field.set(kept)
    assert identifier.state_bytes == before
    assert snapshot.restore(identifier, image) is SnapshotStatus.RESTORED


@pytest.mark.parametrize("name", BOTH)
def test_every_table_entry_that_differs_is_seen_and_no_other(name: str, native: Native) -> None:
    subject = subjects(native)[name]
    identifier, tables = subject.identifier, subject.empty_tables()
    assert isinstance(identifier, Identifier)
    assert subject.status_with({}) is Status.OK
    image = snapshot.save(identifier)
    for field, entries in subject.entries.items():
        for place in range(entries + 1):  # the last is none of them
            tables[field][place] = 1
            seen = snapshot.restore(identifier, image) is SnapshotStatus.OTHER_CONFIG
            assert seen == (place < entries), (field, place)
            tables[field][place] = 0


@pytest.mark.parametrize("name", BOTH)
def test_bad_snapshot_changes_nothing(name: str, native: Native) -> None:
    identifier = made(native, name)
    image = snapshot.save(identifier)
    before = identifier.state_bytes
    for place in (*range(0, 36, 4), 36, len(image) // 2, len(image) - 5, len(image) - 1):
        for bit in (1, 128):
            damaged = image[:place] + bytes([image[place] ^ bit]) + image[place + 1 :]
            assert snapshot.restore(identifier, damaged) is not SnapshotStatus.RESTORED, place
    for length in (0, 3, 35, 39, 40, len(image) // 2, len(image) - 1):
        status = SnapshotStatus.NONE if length < 40 else SnapshotStatus.CUT_SHORT
        assert snapshot.restore(identifier, image[:length]) is status
    sealed = image[:8] + b"\x00\x00\x00\x7f" + image[12:-4]
    other = sealed + zlib.crc32(sealed).to_bytes(4, "little")
    assert snapshot.restore(identifier, other) is SnapshotStatus.OTHER_VERSION
    assert identifier.state_bytes == before
    assert snapshot.restore(identifier, image + b"and what follows") is SnapshotStatus.RESTORED


@pytest.mark.parametrize("name", BOTH)
def test_power_that_fails_at_any_byte_leaves_the_older_slot(
    name: str, native: Native, standard_20_bits: Simulation
) -> None:
    identifier = made(native, name)
    phi, y = samples_for(name, standard_20_bits)
    identifier.run(phi[:1500], y[:1500], sums=False)
    older = snapshot.save(identifier, 1)
    identifier.run(phi[1500:2000], y[1500:2000], sums=False)
    newer = snapshot.save(identifier, 2)
    slot = snapshot.save(identifier, 0)  # what the slot held before
    for cut in range(len(newer)):
        torn = newer[:cut] + slot[cut:]
        if torn != newer:
            assert snapshot.choose(native, older, torn) == snapshot.Choice(0, 1, 2), cut
    assert snapshot.choose(native, older, newer) == snapshot.Choice(1, 0, 3)
    restored = made(native, name)
    assert snapshot.restore(restored, older) is SnapshotStatus.RESTORED
    restored.run(phi[1500:2000], y[1500:2000], sums=False)
    assert snapshot.save(restored, 2) == newer


@given(noise=st.binary(max_size=200))
def test_noise_is_never_a_snapshot(noise: bytes) -> None:
    native = Native()
    identifier = made(native, "strong")
    assert snapshot.restore(identifier, noise) is not SnapshotStatus.RESTORED
    slot = noise.ljust(200, b"\xff")
    assert snapshot.choose(native, slot, slot[::-1]) == snapshot.Choice(None, 0, 1)


def test_slots_are_chosen_by_generation(native: Native) -> None:
    older, newer = (snapshot.save(made(native, "strong"), generation) for generation in (7, 8))
    assert snapshot.choose(native, older, newer) == snapshot.Choice(1, 0, 9)
    assert snapshot.choose(native, newer, older) == snapshot.Choice(0, 1, 9)
    assert snapshot.choose(native, older, newer[:-1] + b"?") == snapshot.Choice(0, 1, 8)
