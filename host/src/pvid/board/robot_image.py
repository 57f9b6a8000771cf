"""The replay image of a robot with a recording: its hash against that of the host, and what a tick costs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from pvid.board.boards import Board
from pvid.board.mechanism_image import build_with, refuse_float_on_avr
from pvid.board.strong_image import replay_header
from pvid.codegen.files_robot import RobotFiles

_IDENTIFIER = """\
typedef struct {{
    pvid_robot_f32 estimator;
    float memory[{upper}_MEMORY];
}} replay_robot;

static inline pvid_status replay_init(replay_robot *self, const pvid_robot_config_f32 *config)
{{
    return pvid_robot_init_f32(&self->estimator, config, self->memory, {upper}_MEMORY);
}}

#define REPLAY_TYPE replay_robot
#define REPLAY_INIT replay_init
#define REPLAY_STEP(self, sample) pvid_robot_step_f32(&(self)->estimator, (sample))
#define REPLAY_HASH pvid_robot_hash_f32
#define REPLAY_HAS_BITS
#define REPLAY_FAULTS pvid_arithmetic_faults_f32()
#define replay_config {name}_config_f32"""


def build_robot_image(target: Board, files: RobotFiles, samples: npt.ArrayLike) -> tuple[Path, Path]:
    """Builds the image of samples [ticks, 2 n] for a board; the files have a design. Costs are of the second half.

    Returns
    -------
    The image, and the tree it was built in.
    """
    refuse_float_on_avr(target)
    words = np.ascontiguousarray(samples, np.float32).view(np.uint32)
    name = files.name
    includes = ['#include "pvid/arithmetic.h"', '#include "pvid/fnv_word.h"', f'#include "{name}_design_f32.h"']
    identifier = _IDENTIFIER.format(name=name, upper=name.upper())
    header = replay_header(name, words, ("float", "uint32_t"), includes, [identifier], len(words) // 2)
    texts = {one: text for one, text in files.files().items() if one.endswith((".h", ".c"))}
    return build_with(target, f"{name}-robot-{len(words)}", texts | {"replay_run.h": header}, {}, "f32", "robot")
