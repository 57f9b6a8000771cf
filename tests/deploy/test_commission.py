"""A commissioning of whole mechanisms: the package that is deployed, compiled, drives the simulated plant."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from own_mechanisms import OWN
from packages import run

from pvid.base.errors import PvidError
from pvid.configuration.excitation import designed
from pvid.configuration.weak import config_for_recording
from pvid.deploy.of_rig import deployment_f32
from pvid.deploy.targets import write_package
from pvid.model.compiled import CompiledModel
from pvid.models.mechanisms import compiled_of
from pvid.sim.plant import Plant

DONE = 1
WARNINGS = ("-Wall", "-Wextra", "-Werror")
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


class Commissioned:
    """A commissioning of a simulated plant at `truth` (the guesses where none is given)."""

    def __init__(
        self,
        compiled: CompiledModel,
        limits: Limits,
        rate: float,
        folder: Path,
        truth: Mapping[str, float] | None = None,
        *,
        search: bool = False,
    ) -> None:
        names = [one.name for one in compiled.signals]
        excitation = designed(compiled, limits, rate, samples=names, search=search)
        config = config_for_recording(compiled, excitation.recording)
        assert list(config.design.model.sample_names) == names
        made = deployment_f32(compiled, config, excitation.recording.signals, "a test", excitation=excitation)
        write_package(made, "cmake", folder / "p")
        (folder / "read.c").write_text(READ.format(name=made.name, count=len(compiled.unknowns)), encoding="utf-8")
        sources = [str(one) for one in sorted((folder / "p" / "src").rglob("*.c"))]
        options = ("-std=c99", "-O1", "-shared", "-fPIC", "-ffp-contract=off", "-Ip/src", *WARNINGS)
        run("gcc", *options, "read.c", *sources, "-lm", "-o", "it.so", cwd=folder)
        self._c = ctypes.CDLL(str(folder / "it.so"))
        self._name, self.model, self.rate = made.name, compiled, rate
        self.truth = np.array([(truth or {}).get(one.name, one.guess) for one in compiled.unknowns])
        self.ticks = 3 * round((excitation.burst_s + 3 * excitation.ramp_s) * rate)
        self.drives = [one.name for one in excitation.drives]
        self._run(Plant(compiled))

    def _call(self, what: str, *given: Any) -> int:
        return int(getattr(self._c, f"{self._name}_commission_{what}")(*given))

    def _run(self, plant: Plant) -> None:
        rng = np.random.default_rng(3)
        model, motion = self.model, plant.motion
        places = {one.name: motion.state(one.name) for one in model.signals if one.kind == "sensor"}
        assert self._call("init") == 0
        assert self._call("start")
        sample, drive = np.zeros(len(model.signals), np.float32), np.zeros(max(len(self.drives), 1), np.float32)
        knowns = {one.name: one.value for one in model.knowns}

        def control(_: float, state: np.ndarray[Any, Any]) -> dict[str, float]:
            for k, one in enumerate(model.signals):
                if one.kind == "sensor":
                    x = float(state[places[one.name]])
                    noise = one.noise * (one.resolution or 1.0) * rng.standard_normal()
                    lsb = one.resolution
                    sample[k] = lsb * np.rint((x + noise) / lsb) if lsb else x + noise
            pointers = [one.ctypes.data_as(ctypes.c_void_p) for one in (sample, drive)]
            self._call("step", *pointers)
            while self._call("work"):
                pass
            return dict(zip(self.drives, map(float, drive), strict=False))

        constants = plant.constants(self.truth, knowns)
        self.motion = plant.controlled(constants, plant.start({}), control, self.rate, self.ticks)
        count = len(model.unknowns)
        value, error, more = (np.zeros(n, np.float32) for n in (count, count, 6))
        pointers = [one.ctypes.data_as(ctypes.c_void_p) for one in (value, error, more)]
        self.verdict = int(self._c.read_result(*pointers))
        self.value, self.error = value.astype(float), error.astype(float)
        self.difference, self.misfit, self.restrained = float(more[0]), more[1:3].tolist(), float(more[3])

    def largest(self, name: str) -> float:
        """Largest absolute value of a signal of the true motion."""
        return float(np.abs(self.motion[name]).max())


CART = {"": {"burst_s": 6.0}, "F": {"limit": 12.0, "slew": 400.0}, "x": {"limit": 0.3}, "a": {"limit": 1.2}}
OTHER_CART = {"mt": 0.7, "ml": 0.05, "J": 0.012, "b": 1.2, "Fc": 0.25, "bp": 2.5e-3, "c": 0.04}


def assert_within(one: Commissioned) -> None:
    """The rail, the angle and the force of CART."""
    assert one.largest("x") < 0.3 and one.largest("a") < 1.2 and one.largest("F") <= 12.0


def test_a_plate_without_limits_of_its_sensor_is_commissioned(tmp_path: Path) -> None:
    plate = OWN["heated_plate"]
    truth = {one.name: 1.3 * one.guess for one in plate.compiled.unknowns}
    limits = {"": {"burst_s": 300.0}, "P": {"limit": 40.0}}
    one = Commissioned(plate.compiled, limits, plate.rate, tmp_path, truth)
    assert one.verdict == DONE
    assert (np.abs(one.value - one.truth) < 5 * one.error).all()
    assert (one.error < 0.05 * one.truth).all()
    assert one.largest("P") <= 40.0


def test_a_cart_that_friction_nearly_holds_is_refused(tmp_path: Path) -> None:
    """The table by rule is too weak for it: the limits are kept, and no value is called done."""
    one = Commissioned(compiled_of("cart_pendulum"), CART, 500.0, tmp_path, OTHER_CART)
    assert_within(one)
    assert one.verdict in (3, 4)


def test_a_drive_without_a_limit_is_asked_for() -> None:
    with pytest.raises(PvidError, match=r"\[excitation\.V\] limit = 12"):
        designed(compiled_of("dc_motor"), {"phi": {"speed": 100.0}}, 1000.0, samples=("V", "i", "phi"))
