"""Python packages that not everybody needs, and the line that installs a missing one.

pvid itself is in no registry: a line names the packages, and the interpreter that runs pvid.
"""

from __future__ import annotations

import shlex
import sys

# By module; the extras of host/pyproject.toml have their ranges of versions.
PACKAGES = {
    "dask": "dask distributed",
    "distributed": "dask distributed",
    "foxglove": "foxglove-sdk",
    "matplotlib": "matplotlib",
    "mcap": "mcap",
    "pyarrow": "pyarrow",
    "serial": "pyserial",
    "starlette": "starlette",
    "uvicorn": "uvicorn",
}


def installing(*modules: str) -> str:
    """The line that installs the packages of these modules, which are in PACKAGES."""
    return f"{shlex.quote(sys.executable)} -m pip install {' '.join(PACKAGES[one] for one in modules)}"
