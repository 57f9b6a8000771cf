"""A frozen identifier of the strong form takes nothing in, and goes on without a bump: the bits of the twin, the state.

The weak form: tests/unit/test_weak.c and test_weak_q31.c, tests/twin/test_weak_f32.py.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from pvid.cases import CASES, Case
from pvid.compare.bits import first_difference
from pvid.core.native import Identifier, Native
from pvid.rig.file import RigFile
from pvid.rig.run import Run
from pvid.settings.enums import Reason
from pvid.sim.pendulum import simulate, standard_sensors

FROM, TO = 2_000, 4_345
every_case = pytest.mark.parametrize(
    "case", [CASES["strong", "f32"], CASES["strong", "q31"]], ids=lambda case: case.core
)
both_cores = pytest.mark.parametrize("core", ["f32", "q31"])


@pytest.fixture(scope="module")
def run() -> Run:
    """10 s of the standard rig with an encoder of 14 bits."""
    return simulate(sensors=standard_sensors(14), truth="linear", duration=10.0, seed=1).run


def rig_of(case: Case) -> RigFile:
    """The rig with an identifier that forgets."""
    own = replace(RigFile.standard().identifier, form=case.form, stride=8, forgetting_s=5.0)
    return replace(RigFile.standard(), identifier=own)


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
    phi, y = phi[4_000:7_000], y[4_000:7_000]
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
def test_nothing_moves_while_the_strong_form_is_frozen(core: str, native: Native, run: Run) -> None:
    case = CASES["strong", core]
    before, during, after = frozen_run(identifier_of(native, case), *case.samples(rig_of(case), run))
    assert (during.p == before.p[-1]).all()
    assert (during.sums == before.sums[-1]).all()
    assert (during.reason == Reason.HELD_FROZEN).all()
    assert (after.reason != Reason.WARMING_UP).all()
