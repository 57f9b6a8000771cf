"""Snapshots of the weak form: bits from any tick on, and what differs in any field is refused with its own status.

The fields are those of the headers: a new one that neither the snapshot nor the fingerprint has fails here. The
fixed-point core: tests/core/test_weak_snapshot_q31.py.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import ROOT
from weak_rig import WeakRig, weak_rig
from weak_snapshots import (
    Identifier,
    assert_continues_from_every_tick,
    assert_every_byte_is_kept,
    assert_every_change_is_refused,
    assert_every_function_is_hashed,
)

from pvid.core.weak_native import WeakIdentifier
from pvid.settings.enums import Reason, SnapshotStatus
from pvid.settings.parts import TrustConfig
from pvid.settings.weak import WeakConfig


def identifiers(rig: WeakRig, config: WeakConfig) -> tuple[Identifier, Identifier, WeakIdentifier]:
    """Two identifiers of a configuration, and the owner of its memory."""
    owner = rig.native.identifier_of(config)
    one, other = (Identifier(rig.native.headers.ffi, rig.native.library, "f32", owner.config_pointer) for _ in range(2))
    return one, other, owner


@pytest.mark.parametrize(
    ("name", "compensation", "forgetting"),
    [("kapitza", True, 5.0), ("battery_2rc", False, 0.0), ("two_link_arm", False, 0.0)],
)
def test_a_restored_run_continues_from_every_tick_of_half_a_window(
    name: str, compensation: bool, forgetting: float
) -> None:
    """So from every stage of the sums and of a window."""
    rig = weak_rig(name)
    estimator = replace(rig.config.estimator, forgetting_s=forgetting)
    trust = TrustConfig(se_max=10.0, groups_min=1)
    config = replace(rig.config, estimator=estimator, compensation=compensation, trust=trust)
    half = config.design.hop * config.design.decimation
    one, other, _ = identifiers(rig, config)
    reasons = one.run(rig.samples[: 4 * half + 3])
    assert Reason.UPDATED in reasons or Reason.HELD_UNCERTAIN in reasons
    assert_continues_from_every_tick(one, other, rig.samples[4 * half + 3 : 5 * half + 3])


def test_a_pointer_into_the_object_points_into_the_restored_one() -> None:
    """p goes back to the published estimate, to which the solve in progress then points."""
    rig = weak_rig("cart_pendulum")
    one, other, _ = identifiers(rig, replace(rig.config, trust=TrustConfig(revert_after=1)))
    still = np.zeros((8 * rig.config.design.hop * rig.config.design.decimation, rig.samples.shape[1]), np.float32)
    seen = 0
    for tick in still:
        one.run(tick[np.newaxis])
        if one.state.finish.work.solve.fallback != one.ffi.NULL:
            assert other.restore(one.save()) is SnapshotStatus.RESTORED
            assert other.state.finish.work.solve.fallback == one.ffi.addressof(other.state.trust.estimate, "p")[0]
            seen += 1
    assert seen > 0


def test_every_byte_is_saved_and_restored_but_those_of_pointers() -> None:
    rig = weak_rig("kapitza")
    one, other, _ = identifiers(rig, rig.config)
    ffi, size = one.ffi, one.ffi.sizeof("void *")
    solve = [ffi.offsetof(one.type, "finish", "work", "solve", name) for name in ("fallback", "noise", "estimate")]
    for place in assert_every_byte_is_kept(one, other):
        assert any(first <= place < first + size for first in solve), place
    assert other.state.finish.work.solve.fallback == ffi.addressof(other.state.trust.estimate, "p")[0]
    assert other.state.finish.work.solve.estimate == ffi.addressof(other.state.finish, "candidate")


@pytest.mark.parametrize("core", ["f32", "q31"])
def test_the_layout_names_every_size_of_an_array(core: str) -> None:
    include = ROOT / "firmware" / "include" / "pvid"
    ending = "" if core == "f32" else "_q31"
    parts = ("weak", "estimator", "trust", "gate")
    state = "".join((include / "detail" / f"{part}_state{ending}.h").read_text() for part in parts)
    named = set(re.findall(r"PVID_MAX_\w+", (ROOT / f"firmware/src/persist/snapshot_weak_{core}.c").read_text()))
    derived = {"PVID_MAX_SUMS", "PVID_MAX_SUMS_Q31", "PVID_MAX_C"}  # of moments, theta and p
    assert set(re.findall(r"\bPVID_MAX_\w+", state)) - derived <= named


@pytest.mark.parametrize("name", ["dc_motor", "battery_2rc"])
def test_every_field_and_table_entry_that_differs_is_refused_with_its_status(name: str) -> None:
    rig = weak_rig(name)
    limits = np.ones(rig.samples.shape[1], np.float32)
    one, _, owner = identifiers(rig, replace(rig.config, range=1e6 * limits, drive_min=0 * limits))
    assert_every_change_is_refused(one)
    image, config = one.save(), one.config
    for limit in ("range", "drive_min"):
        kept = getattr(config, limit)
        setattr(config, limit, one.ffi.NULL)
        assert one.restore(image) is SnapshotStatus.OTHER_CONFIG
        setattr(config, limit, kept)
    assert owner.config_pointer != config


def test_a_model_with_the_same_tables_and_another_function_is_another_model() -> None:
    rig = weak_rig("dc_motor")
    one, _, _owner = identifiers(rig, rig.config)
    assert_every_function_is_hashed(one, "void(*)(float *, float *)", None)
    image = one.save()
    nothing = one.ffi.callback("void(*)(float *, float *)", lambda p, theta: None)
    one.config.design.model.model.theta = nothing
    assert one.restore(image) is SnapshotStatus.OTHER_MODEL
