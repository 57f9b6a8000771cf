"""The library of a described mechanism: compiled once, found again, and one sentence where there is no compiler."""

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from pvid.base.errors import PvidError
from pvid.core import model_library
from pvid.core.sizes import default_sizes, least_sizes, raised, smallest
from pvid.core.sources import FIRMWARE, PUBLIC_INCLUDES
from pvid.core.weak_native import WeakNative

MODEL = """
#include <stddef.h>
#include "pvid/weak.h"
extern const pvid_weak_model_f32 tiny_weak_f32;
static void values(const float in[], float out[]) {{ out[0] = {factor} * in[0]; }}
const pvid_weak_model_f32 tiny_weak_f32 = {{.samples = 1, .jets = 1, .gains = 1, .values = values}};
"""
HEADER = '#include "pvid/weak.h"\nextern const pvid_weak_model_f32 tiny_weak_f32;\n'


def texts(factor: str) -> dict[str, str]:
    return {"tiny.h": HEADER, "tiny.c": MODEL.format(factor=factor)}


@pytest.fixture(scope="module", autouse=True)
def built_here(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The cache is an empty one, and the compiler is quick."""
    folder = tmp_path_factory.mktemp("cache")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(model_library, "cache_folder", lambda: folder)
        patch.setattr(model_library, "_FLAGS", [one for one in model_library._FLAGS if one != "-O2"])
        yield


def test_it_is_compiled_once_for_the_same_content() -> None:
    first = model_library.model_library("tiny", texts("2.0f"), {})
    made = first.stat().st_mtime_ns
    assert model_library.model_library("tiny", texts("2.0f"), {}) == first
    assert first.stat().st_mtime_ns == made
    other = model_library.model_library("tiny", texts("3.0f"), {})
    assert other != first
    wider = model_library.model_library("tiny", texts("2.0f"), {"PVID_MAX_P": 8})
    assert wider not in (first, other)
    tiny = model_library.ModelSources("tiny", texts("2.0f"), {})
    one, wide = (WeakNative("tiny", library, tiny) for library in (first, wider))
    assert np.array_equal(one.values([[1.5]]), [[3.0]])
    assert wide.headers.ffi.sizeof("pvid_estimate_f32") > one.headers.ffi.sizeof("pvid_estimate_f32")


def test_code_that_does_not_compile_is_one_sentence() -> None:
    with pytest.raises(PvidError, match="refused the code: .*error"):
        model_library.model_library("tiny", texts("2.0f +"), {})


def test_nothing_is_kept_of_a_core_that_is_edited_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every tree with the sources of before would get it."""
    folder = model_library._kept()
    kept = set(folder.iterdir()) if folder.exists() else set()
    hashes = iter(["before", "after"])
    monkeypatch.setattr(model_library, "_core_hash", lambda: next(hashes))
    with pytest.raises(PvidError, match="have changed while they were compiled: start again"):
        model_library.model_library("tiny", texts("4.0f"), {})
    assert {one for one in folder.iterdir() if not one.name.startswith(".")} <= kept


def test_without_a_compiler_there_is_one_sentence(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    with pytest.raises(PvidError, match="needs a C compiler .cc, gcc or clang, or the one that CC names., and there"):
        model_library.model_library("tiny", texts("2.0f"), {})


def test_sizes_that_exceed_the_defaults_are_the_ones_of_config_h() -> None:
    usual = default_sizes()
    text = (FIRMWARE / "include" / "pvid" / "config.h").read_text(encoding="utf-8")
    assert set(usual) == set(re.findall(r"#ifndef (PVID_MAX_\w+)", text))
    assert usual["PVID_MAX_P"] == 4
    assert raised({"PVID_MAX_P": 7, "PVID_MAX_THETA": 3}) == {"PVID_MAX_P": 7}


def test_the_smallest_sizes_are_within_the_limits_of_config_h(tmp_path: Path) -> None:
    assert set(least_sizes()) == set(default_sizes())
    assert all(least_sizes()[name] <= usual for name, usual in default_sizes().items())
    needed = smallest(dict.fromkeys(default_sizes(), 1))
    (tmp_path / "x.c").write_text('#include "pvid/config.h"\ntypedef int nothing;\n', encoding="utf-8")
    sizes = [f"-D{name}={size}" for name, size in needed.items()]
    command = ["gcc", "-std=c99", *PUBLIC_INCLUDES, "-fsyntax-only", str(tmp_path / "x.c")]
    assert subprocess.run([*command, *sizes], check=False).returncode == 0
    less = [f"-D{name}={size - 1}" for name, size in needed.items() if name == "PVID_MAX_THETA"]
    assert subprocess.run([*command, *less], capture_output=True, check=False).returncode != 0
