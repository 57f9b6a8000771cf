"""Rows of several kinds in fixed point: limits of the sums, and more theta than the library has room for."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from block_models import BlockModelQ31
from test_kinds import N_BITS, ONE, P_BITS, Y_BITS, Pair, config_of, rows_of

from pvid.core.native import Native
from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, sources_of
from pvid.settings.enums import Reason


@pytest.mark.parametrize("loud", range(3))
def test_every_block_keeps_within_its_limit(native: Native, loud: int) -> None:
    """A loud entry in each kind in turn: the sums are divided by 4, and multiplied again when they have faded."""
    random = np.random.default_rng(2)
    model = BlockModelQ31.random(random, (2, 3, 6), 3)
    # held, the sums are the test's subject; with few bits of Y the loudest N theta is within the limit of a row
    pair = Pair(native, model, config_of(model, forgetting_groups=20, kappa_min=ONE // 2, y_bits=8))
    exponents = []
    for number in range(400):
        for kind, own in enumerate(model.real.kinds):
            n = random.integers(-2000, 2000, own.stop - own.start)
            if kind == loud and number < 60:
                n[-1] = 2**28  # 2^56 a row: beyond 2^60 after 16 of them
            assert pair.add(kind, n, 0) is Reason.ACCUMULATED
        pair.solve(ends_group=True)
        exponents.append(int(pair.core.state.information.exponent))
        if number % 20 == 0:
            pair.assert_equal()
    assert max(exponents) == 1
    assert exponents[0] == exponents[-1] == 0


def test_what_cannot_be_added_changes_nothing(native: Native) -> None:
    random = np.random.default_rng(4)
    model = BlockModelQ31.random(random, (4, 9), 4)
    pair = Pair(native, model, config_of(model, gain=ONE // 2))
    fine = np.ones(5, np.int64)
    pair.add(1, fine, 1)
    before = pair.core.sums
    large = fine.copy()
    large[4] = 2**28 + 1
    assert pair.add(1, large, 1) is Reason.REJECTED_SATURATED
    assert pair.add(0, fine[:4], -(2**28) - 1) is Reason.REJECTED_SATURATED
    assert pair.core.add(2, fine, 1) == Reason.NOT_READY  # there are kinds 0 and 1
    g = np.zeros(9, np.int64)
    g[7] = ONE
    assert pair.add_to_b(g, np.full(9, 40)) is Reason.REJECTED_SATURATED
    assert np.array_equal(pair.core.sums, before)
    assert pair.add_to_b(g, np.full(9, 30)) is Reason.ACCUMULATED
    pair.assert_equal()
    assert pair.core.sums[10 + 15 + 7] == before[10 + 15 + 7] + 2**60
    assert pair.core.counters == pair.twin.counters


ROOMY = {"PVID_MAX_P": 8, "PVID_MAX_THETA_Q31": 31, "PVID_MAX_MOMENTS_Q31": 496, "PVID_MAX_C_Q31": 62}


@pytest.fixture(scope="module")
def roomy(tmp_path_factory: pytest.TempPathFactory) -> Native:
    """The core with room for the largest mechanisms, and its headers for cffi as host/native makes them."""
    folder = tmp_path_factory.mktemp("roomy")
    options = ["-std=c99", *(f"-D{name}={size}" for name, size in ROOMY.items())]
    sources = [str(path) for path in sources_of("q31")]
    library = folder / "libpvid_roomy.so"
    subprocess.run(["gcc", *options, "-O1", "-shared", "-fPIC", *INCLUDES, *sources, "-o", str(library)], check=True)
    for name in ("stdbool", "stddef", "stdint", "string", "math"):
        (folder / f"{name}.h").touch()
    (folder / "all.h").write_text('#include "pvid/estimator_q31.h"\n', encoding="utf-8")
    plain = [
        "-E",
        "-P",
        "-nostdinc",
        f"-I{folder}",
        *PUBLIC_INCLUDES,
        str(folder / "all.h"),
        "-o",
        str(folder / "pvid.i"),
    ]
    subprocess.run(["gcc", *options, *plain], check=True)
    return Native(library)


@pytest.mark.parametrize("kind_end", [(5, 10, 15), (15,), (16,), (9, 20, 31), (31,)], ids=str)
def test_more_theta_than_eleven_have_guard_bits(roomy: Native, kind_end: tuple[int, ...]) -> None:
    """As many as the largest mechanisms have, in blocks and in one; every entry of C in the same column."""
    random = np.random.default_rng(5)
    model = BlockModelQ31.random(random, kind_end, 2)
    pair = Pair(roomy, model, config_of(model), ROOMY)
    truth, groups = rows_of(model, random, 40)
    for group in groups:
        for kind, n, y in group:
            assert pair.add(kind, n, y) is Reason.ACCUMULATED
        pair.solve(ends_group=True)
        pair.assert_equal()
    core, twin = pair.core.assess(), pair.twin.assess()
    for field in ("p", "se"):
        assert np.array_equal(core[field][:2], twin[field][:2])
    # twice as far as its standard error is 1 in 20, and there are ten numbers
    assert np.all(np.abs(pair.core.p - truth * 2**P_BITS) < 4 * core["se"][:2])


def test_equal_columns_of_equal_rows_do_not_overflow(roomy: Native) -> None:
    """All entries of N equal: every product has the same sign and the greatest size."""
    random = np.random.default_rng(5)
    for n_theta in (11, 12, 22, 23, 31):
        model = BlockModelQ31.random(random, (n_theta,), 2)
        model = BlockModelQ31(
            replace(model.real, factor=np.ones(n_theta, np.float32), factors=((0, -1),) * n_theta, n_p=1)
        )
        pair = Pair(roomy, model, config_of(model), ROOMY)
        n = np.full(n_theta, (2**24) - 1)  # M_ii h^2 just below 2^30
        for _ in range(16):
            y = n_theta * 2.0 * n[0] / 2**N_BITS * 2**Y_BITS
            assert pair.add(0, n, round(y)) is Reason.ACCUMULATED
            pair.solve(ends_group=True)
            pair.assert_equal()
        assert abs(int(pair.core.p[0]) / 2**P_BITS - 2) < 1e-5
