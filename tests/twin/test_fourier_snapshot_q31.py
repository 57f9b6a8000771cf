"""Snapshots of the fixed-point weak engine: bits from any tick on, what differs is refused with its own status."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from engine_snapshots import (
    Engine,
    assert_continues_from_every_tick,
    assert_every_byte_is_kept,
    assert_every_change_is_refused,
    assert_every_function_is_hashed,
)
from fourier_q31 import SIZES, Core, rig

from pvid.core.headers import Headers
from pvid.core.sources import INCLUDES, SRC
from pvid.settings.enums import Reason

KEEP = ("snapshot", "crc32", "fnv", "snapshot_fourier_q31", "fingerprint_*_q31", "fingerprint_tables")


def headers_in(folder: Path) -> Headers:
    """The declarations that cffi needs, with the sizes of the library."""
    empty = folder / "no_standard_headers"
    empty.mkdir()
    for name in ("stdbool", "stddef", "stdint", "string"):
        (empty / f"{name}.h").write_text("", encoding="utf-8")
    top = folder / "top.h"
    top.write_text(
        '#include "pvid/snapshot_fourier_q31.h"\nextern const pvid_fourier_config_q31 rig_config_q31;\n',
        encoding="utf-8",
    )
    options = ["-E", "-P", "-nostdinc", "-DPVID_PLAIN_NAMES", f"-I{empty}", *(f"-D{one}" for one in SIZES), *INCLUDES]
    done = subprocess.run(["gcc", *options, str(top)], capture_output=True, text=True, check=True)
    return Headers(done.stdout)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Core, Headers]:
    folder = tmp_path_factory.getbasetemp() / "fourier_snapshot_q31"
    folder.mkdir()
    more = [path for name in KEEP for path in sorted((SRC / "keep").glob(f"{name}.c"))]
    return Core(folder, more), headers_in(folder)


def engines(built: tuple[Core, Headers], name: str, ticks: int) -> tuple[Engine, Engine]:
    """Two identifiers of a mechanism that publish early."""
    core, headers = built
    made = rig(name, ticks)
    trust = replace(made.config.trust, groups_min=1, se_max=2**31 - 1)
    library = headers.ffi.dlopen(core.library(made, replace(made.config, trust=trust))._name)
    config = headers.ffi.addressof(library, "rig_config_q31")
    one, other = (Engine(headers.ffi, library, "q31", config) for _ in range(2))
    return one, other


@pytest.mark.parametrize("name", ["kapitza", "battery_2rc"])
def test_a_restored_run_continues_from_every_tick_of_half_a_window(name: str, built: tuple[Core, Headers]) -> None:
    one, other = engines(built, name, 3000)
    made = rig(name, 3000)
    half = made.design.hop * made.design.decimation
    readings = made.counts.T.astype(np.int32)
    first = 3 * half + 3
    reasons = one.run(readings[:first])
    assert {Reason.UPDATED, Reason.MISFIT, Reason.HELD_UNCERTAIN, Reason.HELD_NOT_EXCITED} & set(reasons)
    assert_continues_from_every_tick(one, other, readings[first : first + half])


def test_every_byte_is_saved_and_restored_but_those_of_pointers(built: tuple[Core, Headers]) -> None:
    one, other = engines(built, "kapitza", 3000)
    assert assert_every_byte_is_kept(one, other) == []  # every pointer is that of init


@pytest.mark.parametrize("name", ["dc_motor", "battery_2rc"])
def test_every_field_and_table_entry_that_differs_is_refused_with_its_status(
    name: str, built: tuple[Core, Headers]
) -> None:
    assert_every_change_is_refused(engines(built, name, 3000)[0])


def test_a_model_with_the_same_tables_and_another_function_is_another_model(built: tuple[Core, Headers]) -> None:
    assert_every_function_is_hashed(engines(built, "dc_motor", 3000)[0], "bool(int32_t *, int32_t *)", True)
