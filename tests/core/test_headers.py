"""What Python reads from the C headers, and what it keeps in a form of its own."""

from __future__ import annotations

import subprocess
import sys

from conftest import ROOT

from pvid.core.native import Native
from pvid.settings.bounds import MAX_MOMENTS, MAX_WINDOW
from pvid.twin import estimates


def test_the_enumerations_are_those_of_the_headers() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "print_enums.py", "--check"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_twin_lays_its_estimates_out_as_the_core_does(native: Native) -> None:
    assert native.headers.dtype("pvid_estimate_f32") == estimates.F32
    assert native.headers.dtype("pvid_estimate_q31") == estimates.Q31


def test_the_sizes_are_those_of_the_build(native: Native) -> None:
    differentiator, sums = (native.headers.dtype(f"pvid_{one}_f32") for one in ("differentiator", "information"))
    assert differentiator["history"].shape == (MAX_WINDOW,)
    assert sums["high"].shape == (MAX_MOMENTS + 11 + 2,)
