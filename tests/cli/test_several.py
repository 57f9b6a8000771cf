"""Several recordings of a mechanism in one call of `pvid identify`."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from in_process import pvid

import pvid as api
from pvid.base.console import DONE
from pvid.base.errors import PvidError

TRUTH = {"m": 1.0, "b": 1.0, "k": 50.0}
SPRING = """
from pvid.model import Model
model = Model("mass on a spring")
F = model.input("F", "N", hold="zoh", reach=5, gain_sd=0)
x = model.sensor("x", "m", resolution=1e-5, reach=0.1)
m, b, k = model.unknown("m", "kg", 1.0), model.unknown("b", "N*s/m", 1.0), model.unknown("k", "N/m", 50.0)
model.equation(m * x.d(2) + b * x.d() + k * x - F)
"""


@pytest.fixture(scope="module")
def springs(tmp_path_factory: pytest.TempPathFactory) -> list[str | Path]:
    """Simulated runs of a mass on a spring with rig files beside them, and its model."""
    folder = tmp_path_factory.mktemp("springs")
    model = folder / "spring.py"
    model.write_text(SPRING)
    paths = [folder / f"s{seed}.csv" for seed in (1, 2)]
    for seed, path in enumerate(paths, 1):
        given = ["--duration", "8", "--rate", "500", "--seed", str(seed)]
        assert pvid("model", "simulate", model, path, *given).return_value == DONE
    return [*paths, "--model", model]


def found(*arguments: str | Path) -> dict[str, Any]:
    answer: dict[str, Any] = json.loads(pvid("identify", *arguments, "--json").stdout)
    for name, truth in TRUTH.items():
        one = answer["parameters"][name]
        assert abs(one["value"] - truth) < 4 * one["se"]
    return answer


def test_recordings_are_identified_together(springs: list[str | Path]) -> None:
    both, alone = found(*springs), found(springs[0], *springs[2:])
    assert both["samples"] > 2 * alone["samples"] and both["status"] == "good"
    for name in TRUTH:
        # twice the data: 0.71 times the standard error, of which either run's estimate is off by 15 %
        assert both["parameters"][name]["se_noise"] < 0.9 * alone["parameters"][name]["se_noise"]


def test_the_refinement_fits_all_recordings(springs: list[str | Path]) -> None:
    both = found(*springs, "--refine")
    assert "longest segment" not in both["refinement"]["text"] and both["refinement"]["chi2"] < 1.2


def test_the_c_core_takes_one_recording_after_the_other(springs: list[str | Path]) -> None:
    both, alone = found(*springs, "--core", "f32"), found(springs[0], *springs[2:], "--core", "f32")
    # the missing ticks between them are no windows; a design may have windows of half or twice the length
    assert 0.8 * alone["windows"] < both["windows"] < 5 * alone["windows"]
    assert all(both["parameters"][name]["se_noise"] < alone["parameters"][name]["se_noise"] for name in TRUTH)


def test_own_parameters_have_the_names_of_the_files(springs: list[str | Path]) -> None:
    answer = json.loads(pvid("identify", *springs, "--own", "m,b", "--validate", springs[0], "--json").stdout)
    assert set(answer["parameters"]) == {"m[s1]", "m[s2]", "b[s1]", "b[s2]", "k"}
    assert answer["validation"]["fitted"]["m"] == pytest.approx(1.0, rel=1e-3)
    table = pvid("identify", *springs, "--own", "m", "--refine")
    assert "m[s1]" in table.stdout and "each recording has its own m" in table.stderr
    with pytest.raises(PvidError, match="there is one"):
        pvid("identify", springs[0], *springs[2:], "--own", "m")


@pytest.mark.parametrize("more", [["--form", "strong"], ["--on", "stream-host"], ["--refine", "--core", "f32"]])
def test_what_takes_one_recording_refuses_several(springs: list[str | Path], more: list[str]) -> None:
    with pytest.raises(PvidError, match="takes one recording"):
        pvid("identify", *springs, *more)


def test_rig_files_that_differ_are_refused(springs: list[str | Path], tmp_path: Path) -> None:
    other = tmp_path / "other.csv"
    first = Path(springs[0])
    other.write_bytes(Path(springs[1]).read_bytes())
    other.with_suffix(".toml").write_text(first.with_suffix(".toml").read_text() + "\n[nominal]\nk = 60.0\n")
    with pytest.raises(PvidError, match=r"the rig files of s1\.csv and other\.csv differ"):
        pvid("identify", first, other, *springs[2:])


def test_a_wrong_file_among_several_is_named(springs: list[str | Path], tmp_path: Path) -> None:
    with pytest.raises(PvidError, match=r"none\.csv does not exist"):
        pvid("identify", springs[0], tmp_path / "none.csv", *springs[2:])


def test_the_pendulum_takes_the_road_of_every_mechanism(tmp_path: Path) -> None:
    paths = [tmp_path / f"p{seed}.csv" for seed in (1, 2)]
    for seed, path in enumerate(paths, 1):
        assert pvid("simulate", path, "--duration", "12", "--seed", str(seed)).return_value == 0
    answer = json.loads(pvid("identify", *paths, "--json").stdout)
    assert answer["identified"] and answer["model"] == "kapitza" and answer["core"] == "f64"
    assert answer["parameters"]["g"]["value"] == pytest.approx(9.5, rel=0.1)  # the rows are linear in the angles


def test_python_takes_a_list_of_files_or_of_arrays(springs: list[str | Path]) -> None:
    files, model = [str(one) for one in springs[:2]], str(springs[3])
    by_files = api.identify(files, model=model)
    arrays = [dict(zip("tFx", np.loadtxt(one, delimiter=",", skiprows=1).T, strict=True)) for one in files]
    by_arrays = api.identify(arrays, model=model, settings={"sensor.F.gain_sd": 0})
    for name, truth in TRUTH.items():
        assert abs(by_files[name].value - truth) < 4 * by_files[name].se
        assert by_arrays[name].value == pytest.approx(by_files[name].value, rel=1e-6)
    assert "1 from 0 s and 2 from" in " ".join(by_arrays.notes)
    with pytest.raises(PvidError, match="list of recordings is empty"):
        api.identify([], model=model)
