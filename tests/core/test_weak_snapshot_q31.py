"""Snapshots of the fixed-point weak identifier: bits from any tick on, what differs is refused with its own status."""

from dataclasses import replace

import numpy as np
import pytest
from weak_rig_q31 import rig
from weak_snapshots import (
    Identifier,
    assert_continues_from_every_tick,
    assert_every_byte_is_kept,
    assert_every_change_is_refused,
    assert_every_function_is_hashed,
)

from pvid.codegen.weak_library import weak_native_q31
from pvid.core.weak_native_q31 import WeakIdentifierQ31
from pvid.settings.enums import Reason


def identifiers(name: str) -> tuple[Identifier, Identifier, WeakIdentifierQ31]:
    """Two identifiers of a mechanism that publish early, and the owner of their settings."""
    made = rig(name, 3000)
    trust = replace(made.config.trust, groups_min=1, se_max=2**31 - 1)
    native = weak_native_q31(made.fixed, made.parameters, replace(made.config, trust=trust))
    owner = native.identifier()
    one, other = (Identifier(native.headers.ffi, native.library, "q31", owner.config_pointer) for _ in range(2))
    return one, other, owner


@pytest.mark.parametrize("name", ["kapitza", "battery_2rc"])
def test_a_restored_run_continues_from_every_tick_of_half_a_window(name: str) -> None:
    one, other, _owner = identifiers(name)
    made = rig(name, 3000)
    half = made.design.hop * made.design.decimation
    readings = made.counts.T.astype(np.int32)
    first = 3 * half + 3
    reasons = one.run(readings[:first])
    assert {Reason.UPDATED, Reason.MISFIT, Reason.HELD_UNCERTAIN, Reason.HELD_NOT_EXCITED} & set(reasons)
    assert_continues_from_every_tick(one, other, readings[first : first + half])


def test_every_byte_is_saved_and_restored_but_those_of_pointers() -> None:
    one, other, _owner = identifiers("kapitza")
    assert assert_every_byte_is_kept(one, other) == []  # every pointer is that of init


@pytest.mark.parametrize("name", ["dc_motor", "battery_2rc"])
def test_every_field_and_table_entry_that_differs_is_refused_with_its_status(name: str) -> None:
    one, _, _owner = identifiers(name)
    assert_every_change_is_refused(one)


def test_a_model_with_the_same_tables_and_another_function_is_another_model() -> None:
    one, _, _owner = identifiers("dc_motor")
    assert_every_function_is_hashed(one, "bool(*)(int32_t *, int32_t *)", True)
