"""A build without the correction for large angles (PVID_FULL_ANGLE 0) links, keeps the bits, refuses the setting."""

from __future__ import annotations

import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

from pvid.base.errors import PvidError
from pvid.board.boards import BOARDS
from pvid.board.replay_image import ReplayRun, build_image, native_hashes, play, standard_run
from pvid.core.native import Native
from pvid.settings.f32 import WeakConfig

TICKS = 5000
LEFT_OUT = {"PVID_FULL_ANGLE": "0"}
BOARD = BOARDS["mps2-an386"]


@pytest.fixture(scope="module")
def run() -> ReplayRun:
    return standard_run("weak", TICKS)


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Native:
    """The library of this machine without the correction."""
    tree = tmp_path_factory.mktemp("without")
    configure = ["cmake", "-S", str(ROOT), "-B", str(tree), "-G", "Ninja", "-DPVID_BUILD_TESTS=OFF"]
    configure += [f"-D{name}={value}" for name, value in LEFT_OUT.items()]
    for command in (configure, ["cmake", "--build", str(tree), "--target", "pvid_native"]):
        subprocess.run(command, check=True, capture_output=True)
    (library,) = tree.rglob("libpvid_native.so")
    return Native(library)


def test_linear_rows_have_the_same_bits(without: Native, native: Native, run: ReplayRun) -> None:
    np.testing.assert_array_equal(native_hashes(run, without), native_hashes(run, native))


def test_the_setting_is_refused(without: Native, native: Native, run: ReplayRun) -> None:
    assert isinstance(run.config, WeakConfig)
    config = replace(run.config, full_angle=True, passes=3)
    native.identifier(config)
    with pytest.raises(PvidError, match="angle"):
        without.identifier(config)


def functions(image: Path) -> set[str]:
    done = subprocess.run([f"{BOARD.tool_prefix}nm", str(image)], capture_output=True, text=True, check=True)
    return {line.split()[-1] for line in done.stdout.splitlines()}


def test_a_boards_image_is_without_its_code(native: Native, run: ReplayRun) -> None:
    image, _ = build_image(BOARD, run, LEFT_OUT)
    whole, _ = build_image(BOARD, run)
    assert not {name for name in functions(image) if "weak_angle" in name}
    assert {name for name in functions(whole) if "weak_angle" in name}
    assert play(BOARD, image, 300.0).hash == native_hashes(run, native)[-1]
