"""The line that an answer prints for a missing term is typed as it stands, and the values are right with it."""

import json
import re
import shlex
from collections.abc import Callable, Mapping
from math import tanh
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from in_process import pvid
from runge_kutta import States, motion

from pvid.base.console import DONE
from pvid.base.errors import PvidError
from pvid.model import Model
from pvid.models.mechanisms import compiled_of, described

Float = npt.NDArray[np.float64]


def written(path: Path, rate: float, signals: Mapping[str, Float]) -> Path:
    t = np.arange(len(next(iter(signals.values())))) / rate
    table = np.column_stack([t, *signals.values()])
    np.savetxt(path, table, delimiter=",", header=",".join(["t", *signals]), comments="", fmt="%.9g")
    return path


def motor_with_brushes(folder: Path) -> tuple[Path, str | Path, dict[str, float]]:
    """The shipped motor, whose brushes drop 0.4 V."""
    random, rate, n = np.random.default_rng(1), 1000.0, 5000
    V = random.uniform(-8, 8, n // 100).repeat(100) + 2 * np.sin(2 * np.pi * 1.3 * np.arange(n) / rate)
    truth = {"R": 1.2, "L": 3e-3, "k": 0.05, "J": 2e-4, "b": 1e-4, "Tc": 0.012}
    R, L, k, J, b, Tc = truth.values()

    def slope(x: States, V: float) -> States:
        i, _, w = x
        sign = tanh(w / 0.05)
        return (V - R * i - k * w - 0.4 * tanh(i / 0.01)) / L, w, (k * i - b * w - Tc * sign) / J

    x = motion(slope, (0.0, 0.0, 0.0), V, 1 / rate, 10)
    i, phi = x[:, 0], x[:, 1]
    i = np.round((i + random.normal(0, 1e-3, n)) / (10 / 2**12)) * (10 / 2**12)
    phi = np.round(phi / (2 * np.pi / 2**12)) * (2 * np.pi / 2**12)
    return written(folder / "motor.csv", rate, {"V": V, "i": i, "phi": phi}), "dc_motor", truth


FREE = """
from pvid.model import Model
m = Model("body on a spring, released")
x = m.sensor("x", "m", resolution=1e-6, reach=1)
d, w2 = m.unknown("d", "1/s", 0.1), m.unknown("w2", "1/s^2", 20)
m.equation(x.d(2) + d * x.d() + w2 * x, "balance")
"""


def free_body_with_drag(folder: Path) -> tuple[Path, str | Path, dict[str, float]]:
    """A mechanism without an input, in a model file of one's own; its drag is also quadratic."""
    rate, n = 200.0, 4000

    def slope(x: States, _: float) -> States:
        return x[1], -0.05 * x[1] - 0.6 * abs(x[1]) * x[1] - 30 * x[0]

    x = motion(slope, (0.5, 0.0), np.zeros(n), 1 / rate, 10)
    x = np.round(x[:, 0] / 1e-6) * 1e-6
    (folder / "free.py").write_text(FREE, encoding="utf-8")
    return written(folder / "free.csv", rate, {"x": x}), folder / "free.py", {"d": 0.05, "w2": 30.0}


CELL = """
from pvid.model import Model
model = Model("RC element behind a resistor")
i = model.input("i", "A", hold="zoh", reach=3, gain_sd=0)
v = model.sensor("v", "V", resolution=1e-5, reach=3)
y = model.unmeasured("y", "V")
R0, R1, T1 = model.unknown("R0", "ohm", 0.4), model.unknown("R1", "ohm", 0.7), model.unknown("T1", "s", 0.5)
model.equation(v - R0 * i - y, "voltage")
model.equation(T1 * y.d() + y - R1 * i, "element")
"""


def cell_with_another_current(folder: Path) -> tuple[Path, str | Path, dict[str, float]]:
    """An algebraic equation; the source gives 0.1 A more than is recorded, in either direction."""
    random, rate, n = np.random.default_rng(3), 100.0, 4000
    i = random.uniform(-2, 2, n // 50).repeat(50)
    true = i + 0.1 * np.sign(i)
    y = motion(lambda x, i: ((0.6 * i - x[0]) / 0.8,), (0.0,), true, 1 / rate, 10)[:, 0]
    v = y + 0.5 * true + random.normal(0, 1e-5, n)
    (folder / "cell.py").write_text(CELL, encoding="utf-8")
    return written(folder / "cell.csv", rate, {"i": i, "v": v}), folder / "cell.py", {"R0": 0.5, "R1": 0.6, "T1": 0.8}


@pytest.mark.parametrize("rig", [motor_with_brushes, free_body_with_drag, cell_with_another_current])
def test_the_line_that_is_printed_is_typed(
    rig: Callable[[Path], tuple[Path, str | Path, dict[str, float]]], tmp_path: Path
) -> None:
    """Words of the advice go into the command as they stand; the model file that is written gives the same values."""
    run, model, truth = rig(tmp_path)
    plain = json.loads(pvid("identify", run, "--model", model, "--json").stdout)
    (line,) = [one for one in plain["advice"] if "--add" in one]
    options = shlex.split(line.partition(": ")[2])
    values = {name: plain["parameters"][name]["value"] for name in truth}
    assert options[0] == "--add"
    assert any(values[name] is None or abs(values[name] - value) > 0.02 * value for name, value in truth.items())
    out = tmp_path / "with.py"
    shown = json.loads(pvid("identify", run, "--model", model, *options, "--write-model", out, "--json").stdout)
    assert shown["without"].keys() < shown["parameters"].keys() and len(shown["added"]) == len(options) / 2
    for name, value in truth.items():
        one = shown["parameters"][name]
        assert abs(one["value"] - value) < 4 * one["se"] + 0.01 * value, (name, one)
    term = plain["missing"]["terms"][0]
    new = next(name for name in shown["parameters"] if name not in plain["parameters"])
    if term["size"] is not None:
        assert shown["parameters"][new]["value"] == pytest.approx(term["size"], rel=0.15)  # to first order
    again = json.loads(pvid("identify", run, "--model", out, "--json").stdout)
    for name in truth:
        assert again["parameters"][name]["value"] == pytest.approx(shown["parameters"][name]["value"], rel=1e-3)


def test_values_without_and_with_the_term_stand_side_by_side(tmp_path: Path) -> None:
    run, model, _ = free_body_with_drag(tmp_path)
    text = pvid("identify", run, "--model", model, "--add", "balance: drag*abs(x.d())*x.d()").stdout
    assert "added: balance: drag*abs(x.d())*x.d()" in text
    row = next(line for line in text.splitlines() if "drag [1/m]" in line)
    assert re.search(r"0\.[56]\d", row)


def test_signal_is_changed_in_every_equation_and_derivative() -> None:
    """The current is 2 % of its square less than recorded: L i' and R i change alike."""
    model = described("dc_motor")
    before = {one.name: one.expression for one in model.equations}
    model.add("i: i + curve*i**2")
    i, i_1, L, curve = (
        next(s for s in model.equations[0].expression.free_symbols if str(s) == name)
        for name in ("i", "i_1", "L", "curve")
    )
    change = (model.equations[0].expression - before["equation 1"]).expand()
    assert change.coeff(L).expand() == (2 * curve * i * i_1).expand()
    assert model.unknowns[-1].unit == "1/A" and not model.unknowns[-1].positive
    assert model.compiled("motor").p_names[-1] == "curve"


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("equation 1: q*z*i", "q and z are new"),
        ("equation 1: sin(a*i)", "a must be a factor"),
        ("a*i", 'write "EQUATION: TERM", with one of equation 1, equation 2'),
        ("equation 3: a*i", "with one of equation 1, equation 2"),
        ("equation 1: a*__import__('os')", "is not for a term"),
        ("equation 1: a*i.conjugate()", "is not for a term"),
        ("equation 1: a*(i", "is no expression"),
    ],
)
def test_term_that_cannot_be_is_one_sentence(text: str, cause: str) -> None:
    with pytest.raises(PvidError, match=re.escape(cause)):
        described("dc_motor").add(text)


def test_term_of_a_stribeck_width_has_no_unit_of_its_own() -> None:
    model = Model("cart")
    x, u = model.sensor("x", "m", resolution=1e-5), model.input("u", "N", hold="zoh")
    model.equation(model.unknown("m", "kg", 1) * x.d(2) - u)
    model.add("f*sgn(x.d())/(1 + (x.d()/0.03)**2)")
    assert model.unknowns[-1].unit == ""


def test_options_without_what_they_need_are_refused(tmp_path: Path) -> None:
    run, model, _ = free_body_with_drag(tmp_path)
    with pytest.raises(PvidError, match="--write-model writes the model with the terms of --add"):
        pvid("identify", run, "--model", model, "--write-model", tmp_path / "a.py")
    with pytest.raises(PvidError, match="the term is 0"):
        pvid("identify", run, "--model", model, "--add", "a*(x - x)")
    assert compiled_of(model).p_names == ("d", "w2") and DONE == 0
