"""What an init of the core refuses, in a sentence: the field, its value, and the range that it must lie in."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from pvid.settings.enums import Status

_LARGE = 3.4e38

# By status: the fields of both stages' configurations that it may mean, with the least and the largest value of each.
# A status that is not here means the field of its name, which has no range.
_RANGES: Mapping[Status, tuple[tuple[str, float, float], ...]] = {
    Status.BAD_SAMPLE_RATE: (("sample_rate", 1e-3, 1e6),),
    Status.BAD_START_SD: (
        ("start_sd", 1e-30, _LARGE),
        ("prior_sd", 1e-9, 1e9),
        ("distance", 0, 1e9),
    ),
    Status.BAD_BOUNDS: (("width", 1e-9, 1e9), ("state_limit", 1e-9, 1e9)),
    Status.BAD_ROW_SD: (("row_sd", 1e-30, _LARGE), ("sd", 1e-15, 1e9)),
    Status.BAD_UPDATE_RATE: (("update_rate", 1e-6, 1e6),),
    Status.BAD_FEEDBACK: (("feedback_hz", 0, _LARGE),),
    Status.BAD_FORGETTING: (("forgetting_s", 0, 1e9),),
    Status.BAD_STEP_LIMIT: (("step_limit", 1e-6, 1e6), ("step_max", 1e-9, 1e6), ("step_fine", 1e-9, 1e6)),
    Status.BAD_KAPPA_MIN: (("kappa_min", 0, 1),),
    Status.BAD_CORRELATION: (("correlation", 1, _LARGE),),
    Status.BAD_DRIVE_MIN: (("drive_min", 0, _LARGE),),
    Status.BAD_ROW_WEIGHT: (("row_weight", 1e-30, 1),),
    Status.BAD_NOISE_MARGIN: (("noise_margin", 0, 1e6),),
    Status.BAD_DEAD_ZONE: (("dead_zone", 0, 100),),
    Status.BAD_SE_MAX: (("se_max", 1e-9, 1e9),),
    Status.BAD_MISFIT_MAX: (("misfit_max", 0, _LARGE), ("chi_max", 1, 1e6), ("clash_max", 1, 1e6)),
    Status.BAD_GATE_SIGMAS: (("sigmas", 0, 1e3), ("outlier_gate", 0, 1e3), ("gate", 0, 1e3)),
    Status.BAD_GATE_PATIENCE: (("patience_s", 0, 1e12),),
    Status.BAD_RANGE: (("range", 1e-9, 1e9),),
    Status.BAD_OVERLAP: (("overlap", 1, 1e6),),
    Status.BAD_DECIMATION: (("decimation", 1, 255), ("ratio", 1, 255), ("parts", 1, 64), ("fine_parts", 1, 64)),
    Status.BAD_ITERATIONS: (("iterations", 1, 255), ("passes", 1, 16), ("most_passes", 1, 16), ("jobs", 1, 128)),
}


def refused(status: Status, *configs: Any, in_counts: bool = False) -> str:
    """The sentence.

    Parameters
    ----------
    configs : settings of the stages that the core was given
    in_counts : they are those of fixed point, whose ranges are other ones
    """
    text = f"the core refused the configuration: {status.text}"
    of_status = _RANGES.get(status, ())
    names = [name for name, _, _ in of_status] or [status.name.removeprefix("BAD_").lower()]
    given = {name: list(_values(name, configs)) for name in names}
    for name, low, high in () if in_counts else of_status:
        for value in given[name]:
            if not low <= value <= high:
                least, most = (f"{low:g}", f" to {high:g}") if high < _LARGE else (f"{low:g} or more", "")
                return f"{text}: {name} is {value:.4g} and must be {least}{most}"
    known = "; ".join(
        f"{name} is {', '.join(f'{one:.4g}' for one in values)}" for name, values in given.items() if values
    )
    return f"{text} (pvid/status.h has its fields and their ranges){': ' + known if known else ''}"


def _values(name: str, settings: Any) -> Iterator[float]:
    """Of a field of this name, at any depth."""
    if isinstance(settings, (tuple, list)):
        for one in settings:
            yield from _values(name, one)
    elif is_dataclass(settings):
        for field in fields(settings):
            value = getattr(settings, field.name)
            if field.name == name and value is not None and not is_dataclass(value):
                yield from (float(one) if math.isfinite(float(one)) else math.nan for one in np.ravel(value))
            elif not isinstance(value, np.ndarray):
                yield from _values(name, value)
