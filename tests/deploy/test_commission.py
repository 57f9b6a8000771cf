"""A commissioning of whole mechanisms: the package that is deployed, compiled, drives the simulated plant."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from own_mechanisms import OWN
from packages import commissioning_of, run

from pvid.base.errors import PvidError
from pvid.configuration.excitation import designed
from pvid.deploy.targets import write_package
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.sim.plant import Plant, Trajectory

DONE = 1
WARNINGS = ("-Wall", "-Wextra", "-Werror")
Float = npt.NDArray[np.float64]
Limits = Mapping[str, Mapping[str, float]]

# What the test reads of the result, in the order of the C below.
READ = """
#include "{name}_commission.h"
int read_result(float value[], float error[], float more[]);
int read_result(float value[], float error[], float more[])
{{
    const pvid_commission_result_f32 *result = {name}_commission_result();
    for (int k = 0; k < {count}; k++) {{ value[k] = result->value[k], error[k] = result->error[k]; }}
    more[0] = result->difference, more[1] = result->misfit[0], more[2] = result->misfit[1];
    more[3] = result->restrained, more[4] = (float)result->reason, more[5] = (float)result->guard;
    return (int)result->verdict;
}}
"""


class Commissioning:
    """A package with a commissioning, compiled, and plants that it drives."""

    def __init__(
        self, compiled: CompiledModel, limits: Limits, rate: float, folder: Path, *, search: bool = False
    ) -> None:
        made, excitation = commissioning_of(compiled, limits, rate, search=search)
        write_package(made, "cmake", folder / "p")
        (folder / "read.c").write_text(READ.format(name=made.name, count=len(compiled.unknowns)), encoding="utf-8")
        sources = [str(one) for one in sorted((folder / "p" / "src").rglob("*.c"))]
        options = ("-std=c99", "-O1", "-shared", "-fPIC", "-ffp-contract=off", "-Ip/src", *WARNINGS)
        run("gcc", *options, "read.c", *sources, "-lm", "-o", "it.so", cwd=folder)
        self._c = ctypes.CDLL(str(folder / "it.so"))
        self._name, self.model, self._rate, self._plant = made.name, compiled, rate, Plant(compiled)
        self._ticks = 3 * round((excitation.burst_s + 3 * excitation.ramp_s) * rate)
        self._drives = [one.name for one in excitation.drives]

    def of(self, truth: Mapping[str, float], seed: int = 3) -> Commissioned:
        """Of the mechanism with these parameters, the guesses where none is given."""
        rng, model, motion = np.random.default_rng(seed), self.model, self._plant.motion
        places = {one.name: motion.state(one.name) for one in model.signals if one.kind == "sensor"}
        assert self._call("init") == 0
        assert self._call("start")
        sample, drive = np.zeros(len(model.signals), np.float32), np.zeros(max(len(self._drives), 1), np.float32)

        def control(_: float, state: np.ndarray[Any, Any]) -> dict[str, float]:
            for k, one in enumerate(model.signals):
                if one.kind == "sensor":
                    x = float(state[places[one.name]])
                    noise = one.noise * (one.resolution or 1.0) * rng.standard_normal()
                    lsb = one.resolution
                    sample[k] = lsb * np.rint((x + noise) / lsb) if lsb else x + noise
            self._call("step", *pointers_to(sample, drive))
            while self._call("work"):
                pass
            return dict(zip(self._drives, map(float, drive), strict=False))

        p = np.array([truth.get(one.name, one.guess) for one in model.unknowns])
        constants = self._plant.constants(p, {one.name: one.value for one in model.knowns})
        moved = self._plant.controlled(constants, self._plant.start({}), control, self._rate, self._ticks)
        value, error, more = (np.zeros(n, np.float32) for n in (len(p), len(p), 6))
        verdict = int(self._c.read_result(*pointers_to(value, error, more)))
        return Commissioned(p, moved, verdict, value.astype(float), error.astype(float), float(more[0]))

    def _call(self, what: str, *given: Any) -> int:
        return int(getattr(self._c, f"{self._name}_commission_{what}")(*given))


@dataclass(frozen=True)
class Commissioned:
    """Its result."""

    truth: Float
    motion: Trajectory
    verdict: int
    value: Float
    error: Float
    difference: float

    def largest(self, name: str) -> float:
        """Largest absolute value of a signal of the true motion."""
        return float(np.abs(self.motion[name]).max())

    def is_right(self) -> bool:
        """Within five standard errors of the truth."""
        return bool((np.abs(self.value - self.truth) < 5 * self.error).all())


def pointers_to(*arrays: np.ndarray[Any, Any]) -> list[ctypes.c_void_p]:
    return [one.ctypes.data_as(ctypes.c_void_p) for one in arrays]


def drawn(model: CompiledModel, rng: np.random.Generator) -> dict[str, float]:
    """Parameters within 30 % of the guesses; those of either sign within half a standard deviation."""
    return {
        one.name: one.guess + (0.3 * one.guess if one.positive else 0.5 * one.sd) * rng.uniform(-1, 1)
        for one in model.unknowns
    }


MOTOR = {"": {"burst_s": 2.0}, "V": {"limit": 12.0}, "i": {"limit": 10.0}, "phi": {"speed": 200.0}}
CART = {"": {"burst_s": 6.0}, "F": {"limit": 12.0, "slew": 400.0}, "a": {"limit": 1.2}, "x": {"limit": 0.3}}
OTHER_CART = {"mt": 0.7, "ml": 0.05, "J": 0.012, "b": 1.2, "Fc": 0.25, "bp": 2.5e-3, "c": 0.04}


def test_a_plate_without_limits_of_its_sensor_is_commissioned(tmp_path: Path) -> None:
    plate = OWN["heated_plate"]
    limits = {"": {"burst_s": 300.0}, "P": {"limit": 40.0}}
    made = Commissioning(plate.compiled, limits, plate.rate, tmp_path)
    one = made.of({one.name: 1.3 * one.guess for one in plate.compiled.unknowns})
    assert one.verdict == DONE and one.is_right()
    assert (one.error < 0.05 * one.truth).all()
    assert one.largest("P") <= 40.0


def test_motors_that_stick_at_reversals_are_commissioned(tmp_path: Path) -> None:
    """Of such, 17 of 60 were refused while windows in which the motor sticks or creeps counted."""
    made = Commissioning(compiled_of("dc_motor"), MOTOR, 1000.0, tmp_path)
    rng = np.random.default_rng(7)
    for seed in range(20):
        one = made.of(drawn(made.model, rng), seed)
        assert one.verdict == DONE and one.is_right()
        assert one.largest("V") <= 12.0 and one.largest("i") < 10.0


def test_a_cart_with_a_pendulum_is_commissioned_within_its_rail(tmp_path: Path) -> None:
    made = Commissioning(compiled_of("cart_pendulum"), CART, 500.0, tmp_path, search=True)
    one = made.of(OTHER_CART)
    assert one.verdict == DONE and one.is_right()
    assert (one.error[:6] < 0.03 * one.truth[:6]).all()
    assert one.largest("x") < 0.3 and one.largest("a") < 1.2 and one.largest("F") <= 12.0


def test_a_drive_without_a_limit_is_asked_for() -> None:
    with pytest.raises(PvidError, match=r"\[excitation\.V\] limit = 12"):
        designed(compiled_of("dc_motor"), {"phi": {"speed": 100.0}}, 1000.0, samples=("V", "i", "phi"))
