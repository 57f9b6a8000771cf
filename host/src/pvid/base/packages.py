"""Python packages that not everybody needs, and the line that installs a missing one.

pvid itself is in no registry: a line names the packages, and the interpreter that runs pvid.
"""

from __future__ import annotations

import shlex
import sys

from pvid.base.errors import PvidError

# By module; the extras of host/pyproject.toml have their ranges of versions.
PACKAGES = {
    "dask": "dask distributed pyarrow",
    "distributed": "dask distributed pyarrow",
    "foxglove": "foxglove-sdk",
    "h5py": "h5py",
    "matplotlib": "matplotlib",
    "mcap": "mcap",
    "mcap_protobuf": "mcap-protobuf-support",
    "mcap_ros1": "mcap-ros1-support",
    "mcap_ros2": "mcap-ros2-support",
    "mujoco": "mujoco",
    "openpyxl": "openpyxl",
    "pandas": "pandas",
    "pyarrow": "pyarrow",
    "serial": "pyserial",
    "starlette": "starlette",
    "uvicorn": "uvicorn",
}


def installing(*modules: str) -> str:
    """The line that installs the packages of these modules, which are in PACKAGES."""
    return f"{shlex.quote(sys.executable)} -m pip install {' '.join(PACKAGES[one] for one in modules)}"


def lacking(what: str, module: str) -> PvidError:
    """The refusal of what needs a package that is not installed."""
    return PvidError(f"{what} needs the Python package {PACKAGES[module]}: {installing(module)}")
