"""A robot's identifier of pvid/robot.h on this computer: generated, compiled and loaded, and as its printed twin."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.codegen.files_robot import CORE, RobotFiles
from pvid.core.model_library import ModelSources
from pvid.core.native import Native
from pvid.core.sources import PUBLIC_FOLDERS, SRC, source
from pvid.model.compiled import CompiledModel
from pvid.settings.cores import ROBOT
from pvid.settings.enums import Status
from pvid.settings.robot_core import RobotCoreDesign
from pvid.twin import fnv
from pvid.twin.printer.program import printed_module

Float32 = npt.NDArray[np.float32]

_MADE_BY = "identification"
_REPLAY_H = """\
#include "{name}_robot.h"

extern const pvid_robot_config_f32 *const {name}_settings;

/* Steps an initialised identifier through samples[ticks][2 n]. */
void pvid_replay_robot_f32(pvid_robot_f32 *self, uint32_t ticks, const float samples[], uint8_t reason[],
                           uint32_t hash[], uint32_t *running_hash);
"""
_REPLAY_C = """\
#include "{name}_replay.h"

#include "{name}_design_f32.h"

const pvid_robot_config_f32 *const {name}_settings = &{name}_config_f32;

void pvid_replay_robot_f32(pvid_robot_f32 *self, uint32_t ticks, const float samples[], uint8_t reason[],
                           uint32_t hash[], uint32_t *running_hash)
{{
    for (uint32_t tick = 0; tick < ticks; tick++) {{
        const pvid_reason found = pvid_robot_step_f32(self, &samples[(size_t)tick * 2u * {upper}_JOINTS]);
        reason[tick] = (uint8_t)found;
        *running_hash = pvid_robot_hash_f32(*running_hash, self, found);
        hash[tick] = *running_hash;
    }}
}}
"""


class RobotNative(Native):
    """An initialised identifier in C. Raises PvidError when there is no compiler, or init refuses the design."""

    def __init__(self, model: CompiledModel, design: RobotCoreDesign) -> None:
        files = RobotFiles(model, _MADE_BY, design)
        words = {"name": files.name, "upper": files.name.upper()}
        texts = {name: text for name, text in files.files().items() if name.endswith((".h", ".c"))}
        texts |= {
            f"{files.name}_replay.h": _REPLAY_H.format(**words),
            f"{files.name}_replay.c": _REPLAY_C.format(**words),
        }
        headers = [f"{files.name}_replay.h"]
        super().__init__(ModelSources(files.name, texts, {}, ROBOT, headers).library())
        self.p = len(model.unknowns)
        self.memory: Float32 = np.zeros(files.memory(design.taps), np.float32)
        self.state = self.headers.ffi.new("pvid_robot_f32 *")
        self._hash = np.array([fnv.START], np.uint32)
        status = Status(
            self.library.pvid_robot_init_f32(
                self.state, getattr(self.library, f"{files.name}_settings"), self._at(self.memory), len(self.memory)
            )
        )
        if status is not Status.OK:
            raise PvidError(f"{model.name}: the C core refuses the design: {status.name}")

    def _at(self, array: npt.NDArray[Any]) -> Any:
        return self.headers.pointer(array)

    def run(self, samples: npt.ArrayLike) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint32]]:
        """Reason and running hash [ticks] of samples [ticks, 2 n]."""
        given = np.ascontiguousarray(samples, np.float32)
        reason, hashes = np.zeros(len(given), np.uint8), np.zeros(len(given), np.uint32)
        self.library.pvid_replay_robot_f32(
            self.state, len(given), self._at(given), self._at(reason), self._at(hashes), self._at(self._hash)
        )
        return reason, hashes

    def read(self) -> tuple[Float32, Float32, int]:
        """Published p and standard errors [p], and how many estimates there were."""
        both, count = np.zeros(2 * self.p, np.float32), np.zeros(1, np.uint32)
        assert self.library.pvid_robot_read_f32(self.state, self._at(both), self._at(count))
        return both[: self.p], both[self.p :], int(count[0])

    def covariance(self) -> Float32 | None:
        """Of the latest estimate [p, p]; None while one is being computed."""
        out = np.zeros((self.p, self.p), np.float32)
        found = [self.library.pvid_robot_covariance_f32(self.state, k, self._at(one)) for k, one in enumerate(out)]
        return out if all(found) else None


class RobotTwin:
    """The same in numpy, printed from the C."""

    def __init__(self, model: CompiledModel, design: RobotCoreDesign) -> None:
        files = RobotFiles(model, _MADE_BY, design)
        texts = {name: text for name, text in files.files().items() if name.endswith((".h", ".c"))}
        texts["settings.c"] = f'#include "{files.name}_design_f32.h"\n'
        roots = [*files.roots, f"{files.name}_config_f32"]
        self._module = module = printed_module(
            [source(f"{one}.c") for one in CORE], [*PUBLIC_FOLDERS, SRC], {}, roots, texts
        )
        self.p, self.state, self._hash = len(model.unknowns), module.pvid_robot_f32(), fnv.START
        memory = [np.float32(0)] * files.memory(design.taps)
        config = getattr(module, f"{files.name}_config_f32")
        assert module.pvid_robot_init_f32(self.state, config, memory, len(memory)) == Status.OK

    def run(self, samples: npt.ArrayLike) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint32]]:
        """As RobotNative.run."""
        given = np.asarray(samples, np.float32)
        reason, hashes = np.zeros(len(given), np.uint8), np.zeros(len(given), np.uint32)
        with np.errstate(all="ignore"):
            for tick, one in enumerate(given):
                reason[tick] = found = self._module.pvid_robot_step_f32(self.state, list(one))
                hashes[tick] = self._hash = self._module.pvid_robot_hash_f32(self._hash, self.state, found)
        return reason, hashes
