"""pvid: pseudo-velocity identification of mechanical systems, on a microcontroller and on the host.

The C library under ``firmware/`` identifies the parameters at a fixed step; this package simulates rigs,
reads recorded runs and proves, bit for bit, that the C code and numpy compute the same.

    result = pvid.identify("run.csv", l1=0.25)       # or a data frame, or a dict of arrays
    result.parameters["g"].value, result.parameters["g"].se, result.identified, result.warning
    result.report("run.html")

`pvid.Model` and `pvid.sgn` describe a mechanism of your own; `pvid.Estimator` estimates the parameters of your own rows
on the C core.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pvid.base.version import __version__

__all__ = ["Estimator", "Model", "PvidError", "Result", "__version__", "identify", "load", "sgn"]

if TYPE_CHECKING:
    from pvid.api.estimator import Estimator
    from pvid.api.identify import identify
    from pvid.api.result import Result, load
    from pvid.base.errors import PvidError
    from pvid.model.description import Model
    from pvid.model.signals import sgn

# Imported when they are first used: SciPy and SymPy take a second.
_HOMES = {
    "Estimator": "pvid.api.estimator",
    "Model": "pvid.model.description",
    "PvidError": "pvid.base.errors",
    "Result": "pvid.api.result",
    "identify": "pvid.api.identify",
    "load": "pvid.api.result",
    "sgn": "pvid.model.signals",
}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'pvid' has no attribute {name!r}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return [*globals(), *_HOMES]
