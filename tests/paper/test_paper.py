"""The paper's identifier by hand against the C core in its literal form: the same bits at every tick and on boards."""

import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from paper_run import (
    HERE,
    MAIN,
    MISSING,
    ROW_SD,
    SIZES,
    TRUTH,
    KeepsRows,
    PaperRun,
    clean,
    compile_with_core,
    replay_header,
)
from processes import PATIENCE_S

from pvid.board.boards import BOARDS
from pvid.board.mechanism_image import build_with
from pvid.board.replay_image import play
from pvid.settings.enums import Core

CORES: tuple[Core, ...] = ("f32", "q31")
# An FPU, none, RISC-V without one; in the long form all but the ATmega328P, whose memory is too small, and the float32
# of an AVR, which is another one. (On both AVRs test_targets plays the fixed-point core.)
FEW = (("f32", "mps2-an386"), ("f32", "microbit"), ("q31", "microbit"), ("f32", "virt-rv32imac"))
ON_BOARDS = [
    pytest.param(core, name, marks=[] if (core, name) in FEW else pytest.mark.long)
    for core in CORES
    for name, board in BOARDS.items()
    if name != "atmega328p" and (core == "q31" or board.toolchain != "avr")
]
COMPILERS = {"gcc -O3": ("gcc", "-O3", "-march=native"), "gcc -Os": ("gcc", "-Os"), "clang": ("clang", "-O2")}


@cache
def wild_run(ticks: int) -> PaperRun:
    """The motion again and again with what happens to sensors: each is missing, dead, stuck at full scale or jumps."""
    random = np.random.default_rng(2)
    counts = np.tile(clean(), (-(-ticks // len(clean())), 1))[:ticks].astype(np.int64)
    for first in range(300, ticks, 700):
        channel, length = random.integers(2), random.integers(1, 60)
        part = counts[first : first + length, channel]
        what = random.integers(5)
        part[:] = (MISSING, 0, part[0], -32767, np.clip(part + random.integers(-9000, 9000), -32767, 32767))[what]
    return PaperRun(counts.astype(np.int16))


def hashes_of(words: npt.NDArray[np.uint32]) -> npt.NDArray[np.uint32]:
    """FNV-1a of the words, after every tick."""
    hash_, out = 0x811C9DC5, []
    for tick in words.astype("<u4"):
        for byte in tick.tobytes():
            hash_ = ((hash_ ^ byte) * 0x01000193) & 0xFFFFFFFF
        out.append(hash_)
    return np.array(out, np.uint32)


@pytest.mark.ticks(short=2500, long=40_000)
@pytest.mark.parametrize("core", CORES)
def test_the_core_has_the_bits_of_the_paper_by_hand(core: Core, ticks: int, tmp_path: Path) -> None:
    run = wild_run(ticks)
    on_core = run.on_core(core, tmp_path)
    assert np.array_equal(run.by_hand(core), on_core)
    assert np.isnan(run.samples).any() and len(np.unique(on_core, axis=0)) > 1000  # values of p


def law_5(y: npt.NDArray[np.float64], n: npt.NDArray[np.float64], begun: KeepsRows) -> npt.NDArray[np.float64]:
    """p after rows Y [rows] and N [rows, 11] by (3) to (5) in float64, with numpy's matrices; theory.md 4."""
    start, lower, upper = (x.astype(np.float64) for x in (begun.p, begun.lower, begun.upper))
    prior = np.diag((2 * ROW_SD / start) ** 2)
    p, m = start, np.zeros((11, 11))
    for row, value in zip(n, y, strict=True):
        w, d1, d2 = p
        powers = w ** np.arange(5)
        slopes = np.arange(1, 5) * powers[:4]  # of w, .., w^4
        theta = np.concatenate([powers[1:3], d1 * powers[:4], d2 * powers])
        c = np.zeros((11, 3))
        c[:, 0] = np.concatenate([slopes[:2], [0], d1 * slopes[:3], [0], d2 * slopes])
        c[2:6, 1], c[6:, 2] = powers[:4], powers
        m += np.outer(row, row)
        d = 1 / np.sqrt(np.diag(c.T @ m @ c + prior))  # the system is badly scaled, not badly conditioned
        pi = d * np.linalg.solve((c.T @ m @ c + prior) * np.outer(d, d), d * (c.T @ row * (value - row @ theta)))
        p = np.clip(p + pi * min(1.0, 0.3 / max(float(np.max(np.abs(pi / p))), 1e-300)), lower, upper)
    return p


def test_law_5_by_hand_is_that_in_float64() -> None:
    """Rounding alone is between them: float32 has 6e-8, the condition of C^T M C is 160."""
    one, begun = KeepsRows(), KeepsRows()
    y, n = one.after(PaperRun(clean()).samples)
    assert np.allclose(one.p, law_5(y, n, begun), rtol=1e-4)
    assert np.allclose(one.p, TRUTH, rtol=0.15) and not np.allclose(one.p, begun.p, rtol=0.05)


@pytest.mark.by_day(4)
@pytest.mark.by_day(2)
@pytest.mark.parametrize("options", COMPILERS.values(), ids=COMPILERS)
@pytest.mark.parametrize("core", CORES)
def test_other_compilers_keep_the_bits(core: Core, options: tuple[str, ...], tmp_path: Path) -> None:
    run = wild_run(5000)
    (tmp_path / "other").mkdir()
    assert np.array_equal(run.on_core(core, tmp_path / "other", *options), run.on_core(core, tmp_path))


def test_fused_products_are_noticed(tmp_path: Path) -> None:
    """The comparison refutes what it is there to refute."""
    run = PaperRun(clean()[:300])
    fused = run.on_core("f32", tmp_path, "gcc", "-march=haswell", "-ffp-contract=fast")
    assert not np.array_equal(run.by_hand("f32"), fused)


@pytest.mark.parametrize("core", CORES)
def test_a_big_endian_processor_has_the_bits_of_the_paper_by_hand(core: Core, tmp_path: Path) -> None:
    run = wild_run(600)
    (tmp_path / "replay_run.h").write_text(replay_header(run, core), encoding="utf-8")
    (tmp_path / "main.c").write_text(MAIN, encoding="utf-8")
    compile_with_core(core, tmp_path / "main.c", tmp_path / "main", "powerpc-linux-gnu-gcc", "-static", f"-I{tmp_path}")
    done = subprocess.run(["qemu-ppc", str(tmp_path / "main")], capture_output=True, text=True, check=True)
    assert np.array_equal(np.array(done.stdout.split(), np.uint32), hashes_of(run.by_hand(core)))


@pytest.mark.parametrize(("core", "board"), ON_BOARDS)
@pytest.mark.ticks(short=600, long=40_000)
def test_a_board_has_the_bits_of_the_paper_by_hand(core: Core, board: str, ticks: int, tmp_path: Path) -> None:
    target = BOARDS[board]
    run = wild_run(min(ticks, target.sample_bytes // 4 - 200))
    header, model = replay_header(run, core), (HERE / f"paper_{core}.h").read_text(encoding="utf-8")
    sizes = {**SIZES, "PVID_MAX_WINDOW": 5}
    image, _ = build_with(
        target, f"paper-{core}", {"replay_run.h": header, f"paper_{core}.h": model}, sizes, core, "strong"
    )
    report = play(target, image, PATIENCE_S)
    hashes = hashes_of(run.by_hand(core) if ticks < 1000 else run.on_core(core, tmp_path))
    assert report.ticks == len(run.counts) and report.differs_at(hashes) is None
