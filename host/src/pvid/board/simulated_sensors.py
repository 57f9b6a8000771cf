"""The simulated sensors of a board without sensors (firmware/apps/stream/sensor.c), for the engine's images."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pvid.design.c_tables import float_literal
from pvid.rig.file import RigFile
from pvid.rig.mechanism_file import MechanismRig
from pvid.twin.sensor import SensorConstants


def sensor_macros(rig: RigFile | MechanismRig, lsb: Mapping[str, float], sample_rate: float) -> list[str]:
    """Lines of stream_rig.h.

    Parameters
    ----------
    rig : a pendulum's rig file has simulated sensors; of another rig the board reads a recording
    lsb : value of a count of each sample, in the order of the argument of step
    sample_rate : [Hz]
    """
    if not isinstance(rig, RigFile):
        none = ", ".join(["0.0f"] * len(lsb))
        return ["#define STREAM_PHI_LSB 0.0f", "#define STREAM_Y_LSB 0.0f", f"#define STREAM_LSB {{{none}}}"]
    names = list(lsb)
    sizes = {name: float_literal(np.float32(one)) for name, one in lsb.items()}
    constants = SensorConstants.standard(rig.l1, sample_rate, lsb["phi"], lsb["y"])
    return [
        f"#define STREAM_PHI_LSB {sizes['phi']}",
        f"#define STREAM_Y_LSB {sizes['y']}",
        f"#define STREAM_PHI {names.index('phi')}u",
        f"#define STREAM_Y {names.index('y')}u",
        f"#define STREAM_LSB {{{', '.join(sizes.values())}}}",
        f"#define STREAM_SENSOR_CONSTANTS {constants.c_initializer}",
    ]
