"""The fixed-point strong form as a user meets it: what it is worth, the command line, the C header under sanitizers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from test_core_q31 import SOURCES, tool

from pvid.base.errors import PvidError
from pvid.cli.main import commands
from pvid.core.native import Native
from pvid.core.sources import INCLUDES
from pvid.design.fir import savitzky_golay
from pvid.oracle import strong as oracle
from pvid.rig.file import Law, RigFile
from pvid.rig.run import write_run
from pvid.settings.enums import Reason
from pvid.settings.q31 import StrongConfigQ31
from pvid.setup.f32 import bank_of, estimator_config, strong_config
from pvid.setup.q31 import counts_of, covariance_of, p_of, se_of, strong_config_q31, strong_design_of
from pvid.sim.pendulum import STANDARD_PENDULUM, Simulation, simulate, standard_sensors, standard_start

TRUTH = STANDARD_PENDULUM.linear
STANDARD = RigFile.standard()
STRONG = replace(
    STANDARD,
    identifier=replace(STANDARD.identifier, form="strong"),
    sensor=replace(STANDARD.sensor, phi_lsb=standard_sensors(20).phi_lsb),
)


@pytest.fixture(scope="module")
def exact() -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Exact derivatives of the standard rig: phi [40001, 5] and u [40001, 3], SI."""
    found = simulate(truth="linear").exact
    assert found is not None
    return found.phi, found.u


def of_law(law: Law, seed: int) -> tuple[RigFile, StrongConfigQ31]:
    rig = replace(STRONG, identifier=replace(STRONG.identifier, law=law))
    return rig, strong_config_q31(rig, 1000.0, standard_start(seed))


def from_exact(
    native: Native, config: StrongConfigQ31, phi: npt.NDArray[np.float64], u: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Final p of the fixed-point core fed rows of exact derivatives."""
    rows, fits = native.strong_rows_q31(config.row, *config.design.integers(phi, u))
    assert fits.all()
    record = native.strong_estimator_q31(config.estimator, config.row).run_rows(rows, sums=False, hashes=False)
    return p_of(config, record.p[-1])


def in_float64(
    rig: RigFile, law: Law, seed: int, phi: npt.NDArray[np.float64], u: npt.NDArray[np.float64], rate: float = 1000.0
) -> npt.NDArray[np.float64]:
    """Final p of the law in float64 on rows of these derivatives at this rate [Hz]."""
    settings = estimator_config(rig, bank_of(rig, 1000.0), standard_start(seed))
    n, y = oracle.strong_rows(phi, u)
    return oracle.identify_strong(
        n,
        y,
        oracle.Settings(
            start=settings.start.astype(np.float64),
            start_sd=settings.start_sd.astype(np.float64),
            lower=settings.lower.astype(np.float64),
            upper=settings.upper.astype(np.float64),
            row_sd=settings.row_sd,
            rate=rate,
            law=law,
            feedback_hz=settings.feedback_hz,
            correlation=settings.correlation,
            step_limit=settings.step_limit,
            kappa_min=settings.kappa_min,
        ),
        estimate_every=len(y),
    ).last.p


@pytest.mark.parametrize("seed", range(5))
def test_exact_derivatives_stationary_law_reaches_the_truth(
    native: Native, exact: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]], seed: int
) -> None:
    """float64's solution of these rows is the truth; it ends within a thousandth of a per cent."""
    _, config = of_law("stationary", seed)
    assert np.abs(from_exact(native, config, *exact) / TRUTH - 1).max() < 1e-5


@pytest.mark.parametrize(
    ("law", "seed"),
    [
        ("stationary", 0),
        ("pseudovelocity", 3),
        pytest.param("stationary", 3, marks=pytest.mark.long),
        pytest.param("pseudovelocity", 0, marks=pytest.mark.long),
    ],
)
def test_exact_derivatives_end_within_a_twentieth_of_a_per_cent_of_float64(
    native: Native, exact: tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]], law: Law, seed: int
) -> None:
    """Law against law, from the same start; within 0.05 %."""
    rig, config = of_law(law, seed)
    reference = in_float64(rig, law, seed, *exact)
    assert np.abs(from_exact(native, config, *exact) / reference - 1).max() < 5e-4


def test_points_of_several_samples_end_where_float64_ends(
    native: Native, standard_20_bits: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    """287 samples as 41 sums of seven: within a hundredth of a per cent of the law in float64 on the same samples."""
    bank, run = savitzky_golay(41, 12, 1, 7), standard_20_bits.run
    monkeypatch.setattr("pvid.setup.q31.bank_of", lambda *_: bank)
    config = strong_config_q31(STRONG, 1000.0, standard_start(0))
    assert config.bank.block == 7
    phi, y = counts_of(STRONG, run)
    p = p_of(config, native.identifier(config).run(phi, y, sums=False, hashes=False).p[-1])
    derivatives = bank.apply(phi * STRONG.sensor.phi_lsb, 1000.0).T, bank.apply(y * STRONG.sensor.y_lsb, 1000.0).T
    reference = in_float64(STRONG, "stationary", 0, derivatives[0], derivatives[1][:, 2:] / STRONG.l1, 1000 / 7)
    assert np.abs(p / reference - 1).max() < 1e-4


@pytest.mark.parametrize(("stride", "told"), [(0, Reason.UPDATED), (20, Reason.MISFIT)])
def test_a_sensor_of_20_bits_is_identified_as_by_float32(
    native: Native, standard_20_bits: Simulation, stride: int, told: Reason
) -> None:
    """On the same counts within a twentieth of a standard error: Savitzky-Golay in 14 bits, and five points, whose 3 %
    of bias both verdicts see."""
    rig = STRONG
    if stride:
        five = replace(rig.identifier, differentiator="finite-difference", stride=stride)
        rig = replace(rig, identifier=five)
    run = standard_20_bits.run
    config = strong_config_q31(rig, 1000.0, standard_start(3))
    core = native.identifier(config)
    record = core.run(*counts_of(rig, run), sums=False, hashes=False)
    last = core.assess()
    p, se = p_of(config, record.p[-1]), se_of(config, last["se"][:3])
    float_core = native.identifier(strong_config(rig, 1000.0, standard_start(3)))
    float_record = float_core.run(run.phi, run.y, sums=False, hashes=False)
    expected, known = float_record.p[-1], float_core.assess()
    assert (np.abs(p - expected) < 0.05 * se).all()
    # s^2 is a difference of sums that agree to about 1e-3: float32 keeps four digits of it
    np.testing.assert_allclose(se, known["se"][:3], rtol=0.02)
    np.testing.assert_allclose(covariance_of(config, last), known["covariance"][:3, :3], rtol=0.05, atol=0)
    np.testing.assert_allclose(last["kappa"] / 2**30, known["kappa"], rtol=0.01)
    assert (record.reason[-1000:] == told).all()
    assert (float_record.reason[-1000:] == told).all()


def test_forgetting_and_the_law_come_from_the_rig_file() -> None:
    rig = replace(STRONG, identifier=replace(STRONG.identifier, forgetting_s=3.0, law="pseudovelocity", divider=4))
    estimator = strong_config_q31(rig, 1000.0).estimator
    assert (estimator.forgetting_groups, estimator.gain, estimator.divider) == (3000, 0, 4)
    rig = replace(rig, identifier=replace(rig.identifier, law="stationary", feedback_hz=25.0))
    assert strong_config_q31(rig, 1000.0).estimator.gain == round(0.1 * 2**30)


# ---- command line


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """A run of the standard rig with 20 bits, 100 Hz, 12 s, five points 20 ms apart, and its rig file."""
    folder = tmp_path_factory.mktemp("strong-q31")
    run = simulate(sensors=standard_sensors(20), truth="linear", sample_rate=100.0, duration=12.0, seed=2).run
    write_run(folder / "run.csv", run)
    settings = replace(STRONG.identifier, differentiator="finite-difference", stride=2)
    replace(STRONG, identifier=settings, sample_rate=100.0).write(folder / "rig.toml")
    return folder / "run.csv", folder / "rig.toml"


def test_the_strong_form_that_is_printed_for_every_model_is_refused_in_fixed_point(
    recorded: tuple[Path, Path], tmp_path: Path
) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[model]\nname = 'kapitza'\n[known]\nl1 = 0.3\n", encoding="utf-8")
    for command in ("identify", "compare"):
        arguments = [command, str(recorded[0]), "--rig", str(rig), "--core", "q31", "--form", "strong"]
        with pytest.raises(PvidError, match="omit --core q31"):
            CliRunner().invoke(commands, arguments, standalone_mode=False, catch_exceptions=False)


@pytest.mark.parametrize(
    ("sensor", "sentence"),
    [
        ({"phi_lsb": 0.0}, "phi_lsb is 0"),
        ({"phi_range": 1e-5}, "phi_range is 2 counts"),
        ({"y_lsb": 0.01}, "y_range is 3 counts"),
        ({"phi_lsb": 2e-8}, "phi_range is 25000000 counts of the sensor and the fixed-point core takes"),
    ],
)
def test_unsupported_size_is_reported(sensor: dict[str, float], sentence: str) -> None:
    rig = replace(STRONG, sensor=replace(STRONG.sensor, **sensor))
    with pytest.raises(PvidError, match=sentence):
        strong_design_of(rig, 1000.0)


PROGRAM = """
#include <stdio.h>
#include "pvid/pvid_q31.h"
#include "table.h"
int main(void)
{
    static pvid_strong_q31 identifier;
    const pvid_kapitza_scale_q31 scale = STRONG_SCALE;
    pvid_estimate_q31 estimate;
    pvid_kapitza_q31 value = {0, 0, 0}, se = {0, 0, 0};
    uint32_t hash = PVID_FNV_START;
    int phi, y;
    if (pvid_strong_init_q31(&identifier, &strong) != PVID_OK) return 1;
    while (scanf("%d %d", &phi, &y) == 2) {
        hash = pvid_fnv_strong_q31(hash, &identifier.estimator, pvid_strong_step_q31(&identifier, phi, y));
        if (hash % 64u == 0u) {
            pvid_kapitza_estimator_assess_q31(&identifier.estimator, &estimate);
            (void)pvid_kapitza_physical_q31(&estimate, &scale, &value, &se);
        }
    }
    printf("%08x", (unsigned)hash);
    return 0;
}
"""


@pytest.fixture(scope="module")
def sanitized(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], list[Path]]:
    """clang with every sanitizer, and the core's objects by it."""
    place = tmp_path_factory.mktemp("sanitized")
    # the hash wraps by its definition, and by nothing else
    (place / "wraps").write_text("[unsigned-integer-overflow]\nfun:pvid_fnv_word\n")
    compiler = ["clang", "-std=c99", "-O0", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Werror", *INCLUDES]
    compiler += ["-fsanitize=address,undefined,integer", "-fno-sanitize-recover=all"]
    compiler.append(f"-fsanitize-ignorelist={place / 'wraps'}")
    objects = [place / f"{source.stem}.o" for source in SOURCES]
    for source, made in zip(SOURCES, objects, strict=True):
        tool(*compiler, "-c", source, "-o", made)
    return compiler, objects
