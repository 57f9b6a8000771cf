"""The commissioning as printed has the bits of the compiled package, tick by tick: drives, states, result."""

import ctypes
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from own_mechanisms import OWN

from pvid.configuration.excitation import Excitation, designed
from pvid.configuration.weak import config_for_recording
from pvid.deploy.commission import AGREE, CHECK_SCALE, MISFIT_MAX, RESTRAINED_MAX
from pvid.deploy.deployment import Deployment
from pvid.deploy.of_rig import deployment_f32
from pvid.deploy.targets import write_package
from pvid.sim.plant import Plant
from pvid.twin.printer.program import printed_module

Float32 = npt.NDArray[np.float32]
CALLS = ("start", "step", "work", "abort", "result_of")
RESULT = ("verdict", "reason", "drive", "guard", "parameter", "difference", "restrained")
LISTS = ("value", "error", "check", "misfit", "outcome")
OF_A_GUARD = ("signal", "of_rate", "low", "soft_low", "soft_high", "high", "response", "push", "ahead_s", "brake")

READ = """
#include <string.h>
#include "{name}_commission.h"
int read_result(unsigned out[]);
int read_result(unsigned out[])
{{
    const pvid_commission_result_f32 *result = {name}_commission_result();
    unsigned n = 0u;
    out[n++] = (unsigned)result->verdict, out[n++] = (unsigned)result->reason, out[n++] = result->drive;
    out[n++] = result->guard, out[n++] = result->parameter;
    memcpy(&out[n++], &result->difference, 4), memcpy(&out[n++], &result->restrained, 4);
    for (int k = 0; k < PVID_MAX_P; k++) {{ memcpy(&out[n++], &result->value[k], 4); }}
    for (int k = 0; k < PVID_MAX_P; k++) {{ memcpy(&out[n++], &result->error[k], 4); }}
    for (int k = 0; k < PVID_MAX_P; k++) {{ memcpy(&out[n++], &result->check[k], 4); }}
    for (int k = 0; k < 2; k++) {{ memcpy(&out[n++], &result->misfit[k], 4); }}
    for (int k = 0; k < 2; k++) {{ out[n++] = (unsigned)result->outcome[k]; }}
    return (int)n;
}}
"""
THE_CONFIG = """
#include "{name}_design_f32.h"
#include "pvid/commission.h"
const pvid_weak_config_f32 *the_config(void);
const pvid_weak_config_f32 *the_config(void)
{{
    return &{name}_config_f32;
}}
"""


class Package:
    """The plate's, compiled; bursts of 90 s within 40 W and 12 K."""

    def __init__(self, folder: Path) -> None:
        plate = OWN["heated_plate"]
        self.compiled, self.rate = plate.compiled, plate.rate
        limits = {"": {"burst_s": 90.0}, "P": {"limit": 40.0}, "T": {"limit": 12.0}}
        names = [one.name for one in plate.compiled.signals]
        self.excitation: Excitation = designed(plate.compiled, limits, plate.rate, samples=names, search=False)
        recording = self.excitation.recording
        config = config_for_recording(plate.compiled, recording, reversals="decided")
        self.made: Deployment = deployment_f32(
            plate.compiled, config, recording.signals, "a test", excitation=self.excitation
        )
        write_package(self.made, "cmake", folder / "p")
        self.sources = sorted((folder / "p" / "src").rglob("*.c"))
        self.headers = folder / "p" / "src"
        (folder / "read.c").write_text(READ.format(name=self.made.name), encoding="utf-8")
        options = ("-std=c99", "-O2", "-shared", "-fPIC", "-ffp-contract=off", f"-I{self.headers}")
        subprocess.run(["gcc", *options, folder / "read.c", *self.sources, "-lm", "-o", folder / "it.so"], check=True)
        self.c = ctypes.CDLL(str(folder / "it.so"))

    def call(self, what: str, *given: Any) -> int:
        return int(getattr(self.c, f"{self.made.name}_commission_{what}")(*given))

    def run(self, scale: float, fault: int, aborted: int) -> tuple[Float32, Float32, list[int], list[int]]:
        """Samples, drives and states of every tick, and the result as words.

        scale : of the parameters; fault, aborted : ticks at which the sensor gives no number, at which it is stopped
        """
        plant, motion = Plant(self.compiled), []
        place = plant.motion.state("T")
        signals = [one.name for one in self.compiled.signals]
        resolution = self.compiled.signal("T").resolution
        ticks = round(2.5 * (self.excitation.burst_s + 2 * self.excitation.ramp_s) * self.rate)
        states: list[int] = []
        assert self.call("init") == 0 and self.call("start")

        def control(_: float, state: npt.NDArray[np.float64]) -> dict[str, float]:
            sample, drive = np.zeros(len(signals), np.float32), np.zeros(1, np.float32)
            x = resolution * np.rint(float(state[place]) / resolution)
            sample[signals.index("T")] = np.nan if len(states) == fault else x
            if len(states) == aborted:
                self.call("abort")
            states.append(self.call("step", *(one.ctypes.data_as(ctypes.c_void_p) for one in (sample, drive))))
            while self.call("work"):
                pass
            motion.append(np.append(sample, drive))
            return {"P": float(drive[0])}

        p = np.array([scale * one.guess for one in self.compiled.unknowns])
        knowns = {one.name: one.value for one in self.compiled.knowns}
        plant.controlled(plant.constants(p, knowns), plant.start({}), control, self.rate, ticks)
        words = (ctypes.c_uint32 * 200)()
        count = int(self.c.read_result(words))
        table = np.array(motion, np.float32)
        return table[:, :-1], table[:, -1], states, list(words[:count])

    def twin(self) -> Any:
        """The printed module of the package's own files."""
        whole = [one for one in self.sources if not one.stem.endswith(("_commission", "_identifier"))]
        roots = [*(f"pvid_commission_{one}_f32" for one in CALLS), "pvid_commission_init_f32", "the_config"]
        return printed_module(
            whole, [self.headers], {}, roots, {"the_config.c": THE_CONFIG.format(name=self.made.name)}
        )


def ready(module: Any, e: Excitation, samples: int) -> Any:
    """The printed commissioning with the package's tables."""
    f32, config = np.float32, module.pvid_commission_config_f32()
    config.weak, config.identifier = module.the_config(), module.pvid_weak_f32()
    config.excite, config.excitation, config.input = [], [], []
    for one in e.drives:
        drive = module.pvid_excite_config_f32()
        drive.sample_rate_hz, drive.low, drive.high = (f32(e.sample_rate), f32(-one.limit), f32(one.limit))
        drive.slew, drive.ramp_s, drive.burst_s = (f32(one.slew), f32(e.ramp_s), f32(e.burst_s))
        drive.parts, drive.guards, drive.measured = (len(one.tones), len(one.guards), samples)
        drive.part, drive.guard = [], []
        for tone in one.tones:
            part = module.pvid_excite_part_f32()
            part.amplitude, part.hz, part.turns = (f32(tone.amplitude), f32(tone.hz), f32(tone.turns))
            drive.part.append(part)
        for own in one.guards:
            guard = module.pvid_excite_guard_f32()
            for name in (*OF_A_GUARD, "smoothing_s"):
                value = getattr(own, name)
                setattr(guard, name, f32(value) if isinstance(value, float) else value)
            drive.guard.append(guard)
        config.excite.append(drive)
        config.excitation.append(module.pvid_excite_f32())
        config.input.append(one.place)
    config.drives, config.passes = len(e.drives), e.passes
    config.ring = [f32(0)] * (samples * e.burst_ticks)
    config.ring_ticks = config.burst_ticks = e.burst_ticks
    config.check_scale, config.agree = f32(CHECK_SCALE), f32(AGREE)
    config.misfit_max, config.restrained_max = f32(MISFIT_MAX), f32(RESTRAINED_MAX)
    self = module.pvid_commission_f32()
    assert module.pvid_commission_init_f32(self, config) == 0
    assert module.pvid_commission_start_f32(self)
    return self


def words_of(result: Any) -> list[int]:
    found: list[Any] = [getattr(result, name) for name in RESULT]
    found += [x for name in LISTS for x in getattr(result, name)]
    return [int(one.view(np.uint32)) if isinstance(one, np.float32) else int(one) for one in found]


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Package:
    return Package(tmp_path_factory.mktemp("plate"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scale", "fault", "aborted", "verdict"),
    [(0.4, -1, -1, 1), (0.1, -1, -1, 1), (1.3, -1, -1, 3), (0.7, -1, 500, 2), (1.0, 400, -1, 2)],
)
def test_drives_states_and_result_have_the_same_bits(
    scale: float, fault: int, aborted: int, verdict: int, package: Package
) -> None:
    """Of a commissioning to its end, one that a limit turns back, one with too little motion, one that is stopped, one
    whose sensor fails."""
    samples, drives, states, words = package.run(scale, fault, aborted)
    module = package.twin()
    self = ready(module, package.excitation, samples.shape[1])
    given, drive = samples.tolist(), [np.float32(0)]
    found_drives, found_states = [], []
    with np.errstate(all="ignore"):
        for k in range(len(given)):
            if k == aborted:
                module.pvid_commission_abort_f32(self)
            found_states.append(int(module.pvid_commission_step_f32(self, list(samples[k]), drive)))
            found_drives.append(drive[0])
            while module.pvid_commission_work_f32(self):
                pass
    assert np.array(found_drives, np.float32).tobytes() == drives.tobytes()
    assert found_states == states
    assert words_of(module.pvid_commission_result_of_f32(self)) == words
    assert words[0] == verdict and states[-1] == 5
