"""What Python reads from the C headers, and what it keeps in a form of its own."""

import subprocess
import sys
from pathlib import Path

import cffi
import pytest
from conftest import ROOT

from pvid.core import headers
from pvid.core.native import Native
from pvid.settings.bounds import MAX_MOMENTS, MAX_WINDOW


def test_the_enumerations_are_those_of_the_headers() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "print_headers.py", "--check"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_sizes_are_those_of_the_build(native: Native) -> None:
    differentiator, sums = (native.headers.dtype(f"pvid_{one}_f32") for one in ("differentiator", "information"))
    assert differentiator["history"].shape == (MAX_WINDOW,)
    assert sums["high"].shape == (MAX_MOMENTS + 11 + 2,)


def test_declarations_are_parsed_once_for_all_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(headers, "cache_folder", lambda: tmp_path)
    text = "typedef struct { int16_t a; float b[3]; } pair; enum { THREE = 3 }; int f(pair *);"
    first = headers.Headers(text)
    monkeypatch.delattr(cffi, "FFI")
    second = headers.Headers(text)
    assert second.dtype("pair") == first.dtype("pair") and second.dtype("pair").itemsize == 16
    with pytest.raises(AttributeError):
        headers.Headers(text.replace("int16_t", "int32_t"))  # another text is parsed


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(headers, "cache_folder", lambda: tmp_path / "file")
    assert headers.Headers("typedef struct { float a; } one;").dtype("one").itemsize == 4
