"""Rows of several kinds in fixed point: limits of the sums, and more theta than the library has room for."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from block_models import BlockModelQ31
from test_kinds import N_BITS, ONE, P_BITS, Y_BITS, config_of, estimator, rows_of

from pvid.core.native import Native
from pvid.core.sources import INCLUDES, PUBLIC_INCLUDES, sources_of
from pvid.settings.enums import Reason


@pytest.mark.parametrize("loud", range(3))
def test_every_block_keeps_within_its_limit(native: Native, loud: int) -> None:
    """A loud entry in each kind in turn: the sums are divided by 4, and multiplied again when they have faded."""
    random = np.random.default_rng(2)
    model = BlockModelQ31.random(random, (2, 3, 6), 3)
    # held, the sums are the test's subject; with few bits of Y the loudest N theta is within the limit of a row
    core = estimator(native, model, config_of(model, forgetting_groups=20, kappa_min=ONE // 2, y_bits=8))
    exponents = []
    for number in range(400):
        for kind, own in enumerate(model.real.kinds):
            n = random.integers(-2000, 2000, own.stop - own.start)
            if kind == loud and number < 60:
                n[-1] = 2**28  # 2^56 a row: beyond 2^60 after 16 of them
            assert core.add(kind, n, 0) == Reason.ACCUMULATED
        core.update()
        exponents.append(int(core.state.information.exponent))
    assert max(exponents) == 1
    assert exponents[0] == exponents[-1] == 0


ROOMY = {"PVID_MAX_P": 8, "PVID_MAX_THETA_Q31": 31, "PVID_MAX_MOMENTS_Q31": 496, "PVID_MAX_C_Q31": 62}


@pytest.fixture(scope="module")
def roomy(tmp_path_factory: pytest.TempPathFactory) -> Native:
    """The core with room for the largest mechanisms, and its headers for cffi as host/native makes them."""
    folder = tmp_path_factory.mktemp("roomy")
    options = ["-std=c99", *(f"-D{name}={size}" for name, size in ROOMY.items())]
    sources = [str(path) for path in sources_of("q31")]
    library = folder / "libpvid_roomy.so"
    traps = ("-fsanitize=signed-integer-overflow", "-fsanitize-undefined-trap-on-error")
    command = ["gcc", *options, "-O1", *traps, "-shared", "-fPIC", *INCLUDES, *sources, "-o", str(library)]
    subprocess.run(command, check=True)
    for name in ("stdbool", "stddef", "stdint", "string", "math"):
        (folder / f"{name}.h").touch()
    (folder / "all.h").write_text('#include "pvid/estimator_q31.h"\n', encoding="utf-8")
    plain = ["-E", "-P", "-nostdinc", f"-I{folder}", *PUBLIC_INCLUDES, str(folder / "all.h")]
    subprocess.run(["gcc", *options, *plain, "-o", str(folder / "pvid.i")], check=True)
    return Native(library)


@pytest.mark.parametrize("kind_end", [(5, 10, 15), (15,), (16,), (9, 20, 31), (31,)], ids=str)
def test_more_theta_than_eleven_have_guard_bits(roomy: Native, kind_end: tuple[int, ...]) -> None:
    """As many as the largest mechanisms have, in blocks and in one; every entry of C in the same column."""
    random = np.random.default_rng(5)
    model = BlockModelQ31.random(random, kind_end, 2)
    core = estimator(roomy, model, config_of(model))
    truth, groups = rows_of(model, random, 40)
    for group in groups:
        for kind, n, y in group:
            assert core.add(kind, n, y) == Reason.ACCUMULATED
        core.update()
    # twice as far as its standard error is 1 in 20, and there are ten numbers
    assert np.all(np.abs(core.p - truth * 2**P_BITS) < 4 * core.assess()["se"][:2])


def test_equal_columns_of_equal_rows_do_not_overflow(roomy: Native) -> None:
    """All entries of N equal: every product has the same sign and the greatest size."""
    random = np.random.default_rng(5)
    for n_theta in (11, 12, 22, 23, 31):
        model = BlockModelQ31.random(random, (n_theta,), 2)
        model = BlockModelQ31(
            replace(model.real, factor=np.ones(n_theta, np.float32), factors=((0, -1),) * n_theta, n_p=1)
        )
        core = estimator(roomy, model, config_of(model))
        n = np.full(n_theta, (2**24) - 1)  # M_ii h^2 just below 2^30
        for _ in range(16):
            y = n_theta * 2.0 * n[0] / 2**N_BITS * 2**Y_BITS
            assert core.add(0, n, round(y)) == Reason.ACCUMULATED
            core.update()
        assert abs(int(core.p[0]) / 2**P_BITS - 2) < 1e-5
