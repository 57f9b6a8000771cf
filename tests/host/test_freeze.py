"""Frozen identifiers take nothing in, and go on without a bump: the bits of the twin, the state before and after."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from pvid import snapshot
from pvid.compare import first_difference
from pvid.native import Native, Reason
from pvid.rig import STANDARD_PENDULUM, simulate, standard_sensors
from pvid.rigfile import RigFile
from pvid.setup import strong_config, weak_config
from pvid.twin.strong import StrongTwin
from pvid.twin.weak import WeakTwin

FROM, TO = 7_000, 12_345
HALF_A_WINDOW = 624  # ticks


@pytest.fixture(scope="module")
def samples() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    run = simulate(sensors=standard_sensors(14), truth="linear", duration=20.0, seed=1).run
    return run.phi, run.y


def rig_with(**identifier: Any) -> RigFile:
    rig = RigFile.standard()
    return replace(rig, identifier=replace(rig.identifier, **identifier))


def frozen_run(core: Any, phi: Any, y: Any) -> Any:
    """The records before, while and after the identifier is frozen."""
    before = core.run(phi[:FROM], y[:FROM], hashes=False)
    core.freeze(True)
    during = core.run(phi[FROM:TO], y[FROM:TO], hashes=False)
    core.freeze(False)
    return before, during, core.run(phi[TO:], y[TO:], hashes=False)


def joined(records: Any, name: str) -> npt.NDArray[Any]:
    return np.concatenate([getattr(record, name) for record in records])


@pytest.mark.parametrize("form", ["weak", "strong"])
def test_a_frozen_run_equals_the_twin(form: str, native: Native, samples: Any) -> None:
    phi, y = samples if form == "weak" else (samples[0][4_000:15_000], samples[1][4_000:15_000])
    rig = rig_with(form=form, stride=8, forgetting_s=5.0)
    mask = np.zeros(len(phi), bool)
    mask[FROM:TO] = True
    twin: Any
    core: Any
    if form == "weak":
        twin, core = WeakTwin(weak_config(rig, 1000.0)), native.weak(weak_config(rig, 1000.0))
    else:
        twin, core = StrongTwin(strong_config(rig, 1000.0)), native.strong(strong_config(rig, 1000.0))
        assert len(phi) < TO  # it ends frozen
    twin.frozen = mask
    expected = twin.run(phi, y)
    records = frozen_run(core, phi, y)
    whole = replace(records[0], **{name: joined(records, name) for name in ("p", "published", "sums", "reason")})
    theirs = [expected.p[:, :, 0], expected.sums[:, :, 0], expected.reason[:, 0]]
    assert first_difference(whole, *theirs, *([expected.published[:, :, 0]] if form == "weak" else [])) is None
    assert (whole.reason[FROM:TO] == Reason.HELD_FROZEN).any()
    assert not (whole.reason[:FROM] == Reason.HELD_FROZEN).any()


def test_nothing_moves_while_the_weak_form_is_frozen(native: Native, samples: Any) -> None:
    core = native.weak(weak_config(rig_with(forgetting_s=5.0), 1000.0))
    _, during, after = frozen_run(core, *samples)
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
    assert after.p[-1, :3] == pytest.approx(STANDARD_PENDULUM.linear, rel=2e-3)


def test_nothing_moves_while_the_strong_form_is_frozen(native: Native, samples: Any) -> None:
    core = native.strong(strong_config(rig_with(form="strong", stride=8), 1000.0))
    before, during, after = frozen_run(core, *samples)
    assert (during.p == before.p[-1]).all()
    assert (during.sums == before.sums[-1]).all()
    assert (during.reason == Reason.HELD_FROZEN).all()
    assert (after.reason != Reason.WARMING_UP).all()


def test_a_frozen_state_is_saved_and_restored(native: Native, samples: Any) -> None:
    config = weak_config(rig_with(), 1000.0)
    core = native.weak(config)
    core.run(samples[0][:FROM], samples[1][:FROM], hashes=False)
    core.freeze(True)
    restored = native.weak(config)
    assert snapshot.restore(restored, snapshot.save(core)) is snapshot.SnapshotStatus.RESTORED
    record = restored.run(samples[0][FROM:TO], samples[1][FROM:TO], hashes=False)
    assert (record.reason == Reason.HELD_FROZEN).any()
