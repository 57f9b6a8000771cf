"""Frozen identifiers take nothing in, and go on without a bump: the bits of the twin, the state before and after."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from linear_rig import LINEAR_RIG

from pvid.cases import CASES, Case
from pvid.core import snapshot
from pvid.core.native import Identifier, Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.run.compare import first_difference
from pvid.settings.enums import Reason, SnapshotStatus
from pvid.sim.pendulum import STANDARD_PENDULUM, simulate, standard_sensors

FROM, TO = 7_000, 12_345
HALF_A_WINDOW = 855  # ticks
every_case = pytest.mark.parametrize("case", CASES.values(), ids=lambda case: f"{case.form}-{case.core}")
both_cores = pytest.mark.parametrize("core", ["f32", "q31"])


@pytest.fixture(scope="module")
def run() -> Run:
    """20 s of the standard rig with an encoder of 14 bits."""
    return simulate(sensors=standard_sensors(14), truth="linear", duration=20.0, seed=1).run


def rig_of(case: Case) -> RigFile:
    """The rig with an identifier that forgets."""
    own = replace(LINEAR_RIG.identifier, form=case.form, stride=8, forgetting_s=5.0)
    return replace(LINEAR_RIG, identifier=own)


def identifier_of(native: Native, case: Case) -> Identifier:
    return native.identifier(case.settings(rig_of(case), 1000.0))


def frozen_run(core: Any, phi: Any, y: Any) -> Any:
    """The records before, while and after the identifier is frozen."""
    before = core.run(phi[:FROM], y[:FROM], hashes=False)
    core.freeze(True)
    during = core.run(phi[FROM:TO], y[FROM:TO], hashes=False)
    core.freeze(False)
    return before, during, core.run(phi[TO:], y[TO:], hashes=False)


def joined(records: Any, name: str) -> npt.NDArray[Any]:
    return np.concatenate([getattr(record, name) for record in records])


@every_case
def test_a_frozen_run_equals_the_twin(case: Case, native: Native, run: Run) -> None:
    phi, y = case.samples(rig_of(case), run)
    if case.form == "strong":
        phi, y = phi[4_000:15_000], y[4_000:15_000]
        assert len(phi) < TO  # it ends frozen
    twin = case.twin(case.settings(rig_of(case), 1000.0))
    twin.frozen = mask_of(phi)
    expected = twin.run(phi, y)
    core = identifier_of(native, case)
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


@both_cores
def test_nothing_moves_while_the_weak_form_is_frozen(core: str, native: Native, run: Run) -> None:
    case = CASES["weak", core]
    _, during, after = frozen_run(identifier_of(native, case), *case.samples(rig_of(case), run))
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
    last = case.p_of(case.settings(rig_of(case), 1000.0), after.p[-1])
    assert last[:3] == pytest.approx(STANDARD_PENDULUM.linear, rel=2e-3)


@both_cores
def test_nothing_moves_while_the_strong_form_is_frozen(core: str, native: Native, run: Run) -> None:
    case = CASES["strong", core]
    before, during, after = frozen_run(identifier_of(native, case), *case.samples(rig_of(case), run))
    assert (during.p == before.p[-1]).all()
    assert (during.sums == before.sums[-1]).all()
    assert (during.reason == Reason.HELD_FROZEN).all()
    assert (after.reason != Reason.WARMING_UP).all()


@both_cores
def test_a_frozen_state_is_saved_and_restored(core: str, native: Native, run: Run) -> None:
    case = CASES["weak", core]
    phi, y = case.samples(rig_of(case), run)
    frozen, restored = (identifier_of(native, case) for _ in range(2))
    frozen.run(phi[:FROM], y[:FROM], hashes=False)
    frozen.freeze(True)
    assert snapshot.restore(restored, snapshot.save(frozen)) is SnapshotStatus.RESTORED
    record = restored.run(phi[FROM:TO], y[FROM:TO], hashes=False)
    assert (record.reason == Reason.HELD_FROZEN).any()
