"""Frozen identifiers take nothing in, and go on without a bump: the bits of the twin, the state before and after."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from linear_rig import LINEAR_RIG

from pvid.cases import case_of
from pvid.core import snapshot
from pvid.core.native import Native
from pvid.rig.file import RigFile
from pvid.run.compare import first_difference
from pvid.settings.enums import Reason, SnapshotStatus
from pvid.setup.f32 import strong_config, weak_config
from pvid.setup.q31 import config_of_q31, p_of
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors
from pvid.twin.strong import StrongTwin
from pvid.twin.weak import WeakTwin

FROM, TO = 7_000, 12_345
HALF_A_WINDOW = 855  # ticks


@pytest.fixture(scope="module")
def samples() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=20.0, seed=1).run
    return run.phi, run.y


def rig_with(**identifier: Any) -> RigFile:
    return replace(LINEAR_RIG, identifier=replace(LINEAR_RIG.identifier, **identifier))


def frozen_run(core: Any, phi: Any, y: Any) -> Any:
    """The records before, while and after the identifier is frozen."""
    before = core.run(phi[:FROM], y[:FROM], hashes=False)
    core.freeze(True)
    during = core.run(phi[FROM:TO], y[FROM:TO], hashes=False)
    core.freeze(False)
    return before, during, core.run(phi[TO:], y[TO:], hashes=False)


def joined(records: Any, name: str) -> npt.NDArray[Any]:
    return np.concatenate([getattr(record, name) for record in records])


def identifier_of(native: Native, form: str, core: str) -> Any:
    """The identifier of a form and core that forgets."""
    rig = rig_with(form=form, stride=8, forgetting_s=5.0)
    if core == "q31":
        return native.identifier(config_of_q31(rig, 1000.0))
    return (
        native.identifier(weak_config(rig, 1000.0)) if form == "weak" else native.identifier(strong_config(rig, 1000.0))
    )


def as_counted(samples: Any, core: str) -> Any:
    """What the core gets of phi and y."""
    if core == "f32":
        return samples
    sensor = RigFile.standard().sensor
    return tuple(
        np.rint(x / lsb).astype(np.int64) for x, lsb in zip(samples, (sensor.phi_lsb, sensor.y_lsb), strict=True)
    )


@pytest.mark.parametrize("form", ["weak", "strong"])
def test_a_frozen_run_equals_the_twin(form: str, native: Native, samples: Any) -> None:
    phi, y = samples if form == "weak" else (samples[0][4_000:15_000], samples[1][4_000:15_000])
    rig = rig_with(form=form, stride=8, forgetting_s=5.0)
    twin: Any
    if form == "weak":
        twin = WeakTwin(weak_config(rig, 1000.0))
    else:
        twin = StrongTwin(strong_config(rig, 1000.0))
        assert len(phi) < TO  # it ends frozen
    twin.frozen = mask_of(phi)
    expected = twin.run(phi, y)
    records = frozen_run(identifier_of(native, form, "f32"), phi, y)
    whole = replace(records[0], **{name: joined(records, name) for name in ("p", "published", "sums", "reason")})
    assert first_difference(whole, expected.lane()) is None
    assert_frozen_in_between(whole.reason)


@pytest.mark.parametrize("form", ["weak", "strong"])
def test_a_frozen_run_equals_the_fixed_point_twin(form: str, native: Native, samples: Any) -> None:
    counts = as_counted(samples, "q31")
    phi, y = counts if form == "weak" else (counts[0][4_000:15_000], counts[1][4_000:15_000])
    config = config_of_q31(rig_with(form=form, stride=8, forgetting_s=5.0), 1000.0)
    twin = case_of(config).twin(config)
    twin.frozen = mask_of(phi)
    expected = twin.run(phi, y)
    core = identifier_of(native, form, "q31")
    records = frozen_run(core, phi, y)
    names = ("p", "published", "sums", "exponent", "reason")
    whole = replace(records[0], **{name: joined(records, name) for name in names})
    assert first_difference(whole, expected.lane()) is None
    assert core.counters == {name: int(of[0]) for name, of in twin.estimator.counters.items()}
    assert_frozen_in_between(whole.reason)


def mask_of(phi: Any) -> npt.NDArray[np.bool_]:
    mask = np.zeros(len(phi), np.bool_)
    mask[FROM:TO] = True
    return mask


def assert_frozen_in_between(reason: npt.NDArray[np.uint8]) -> None:
    assert (reason[FROM:TO] == Reason.HELD_FROZEN).any()
    assert not (reason[:FROM] == Reason.HELD_FROZEN).any()
    assert not (reason[TO:] == Reason.HELD_FROZEN).any()


@pytest.mark.parametrize("core_name", ["f32", "q31"])
def test_nothing_moves_while_the_weak_form_is_frozen(core_name: str, native: Native, samples: Any) -> None:
    core = identifier_of(native, "weak", core_name)
    _, during, after = frozen_run(core, *as_counted(samples, core_name))
    # the window that was being worked off is finished first
    assert (during.p[HALF_A_WINDOW:] == during.p[HALF_A_WINDOW]).all()
    assert (during.sums[HALF_A_WINDOW:] == during.sums[HALF_A_WINDOW]).all()
    told = during.reason[during.reason != Reason.ACCUMULATED]
    assert (told == Reason.HELD_FROZEN).sum() == (TO - FROM) // HALF_A_WINDOW
    # without a bump: no warming up, a window is worked off within one that is half as long, and p is where it was
    assert not (after.reason == Reason.WARMING_UP).any()
    first = np.flatnonzero(np.isin(after.reason, (Reason.UPDATED, Reason.MISFIT)))[0]
    assert first < 2 * HALF_A_WINDOW
    assert after.p[first, :3] == pytest.approx(during.p[-1, :3], rel=2e-3)
    last = after.p[-1] if core_name == "f32" else p_of(config_of_q31(rig_with(), 1000.0), after.p[-1])
    assert last[:3] == pytest.approx(STANDARD_PENDULUM.linear, rel=2e-3)


@pytest.mark.parametrize("core_name", ["f32", "q31"])
def test_nothing_moves_while_the_strong_form_is_frozen(core_name: str, native: Native, samples: Any) -> None:
    core = identifier_of(native, "strong", core_name)
    before, during, after = frozen_run(core, *as_counted(samples, core_name))
    assert (during.p == before.p[-1]).all()
    assert (during.sums == before.sums[-1]).all()
    assert (during.reason == Reason.HELD_FROZEN).all()
    assert (after.reason != Reason.WARMING_UP).all()


@pytest.mark.parametrize("core_name", ["f32", "q31"])
def test_a_frozen_state_is_saved_and_restored(core_name: str, native: Native, samples: Any) -> None:
    phi, y = as_counted(samples, core_name)
    core, restored = (identifier_of(native, "weak", core_name) for _ in range(2))
    core.run(phi[:FROM], y[:FROM], hashes=False)
    core.freeze(True)
    assert snapshot.restore(restored, snapshot.save(core)) is SnapshotStatus.RESTORED
    record = restored.run(phi[FROM:TO], y[FROM:TO], hashes=False)
    assert (record.reason == Reason.HELD_FROZEN).any()
