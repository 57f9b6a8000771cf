"""Packages that not everybody needs: what does without them, and what a message tells to type."""

import re
import subprocess
import sys

import pytest
from conftest import ROOT

from pvid.base.cluster import client as work_client
from pvid.base.errors import PvidError
from pvid.base.packages import PACKAGES, installing

_WITHOUT_SERIAL = """
import importlib, pkgutil, sys
sys.modules["serial"] = None
import pvid
for one in pkgutil.walk_packages(pvid.__path__, "pvid."):
    if not one.name.endswith("__main__"):
        try:
            importlib.import_module(one.name)
        except ModuleNotFoundError as error:
            print(one.name, error.name)
"""


def test_only_the_list_of_ports_needs_pyserial_before_a_port_is_opened() -> None:
    """tune, design, deploy, model build, identify --core and demo among the rest."""
    done = subprocess.run(
        [sys.executable, "-P", "-c", _WITHOUT_SERIAL], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert [line.split()[0] for line in done.stdout.splitlines()] == ["pvid.cli.ports"]


def test_a_port_without_pyserial_names_the_package_and_the_line_that_installs_it() -> None:
    code = "import sys; sys.modules['serial'] = None; sys.argv[1:] = ['ports']; from pvid.cli.main import main; main()"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == f"pvid: this needs the Python package pyserial: {installing('serial')}\n"


def test_work_in_parallel_without_dask_names_the_line_that_installs_all_that_a_batch_needs(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    line = f"work in parallel needs the Python package dask distributed pyarrow: {installing('distributed')}"
    with pytest.raises(PvidError, match=re.escape(line)), work_client(None, 2):
        pass


@pytest.mark.parametrize("module", sorted(PACKAGES))
def test_packages_of_a_message_are_those_of_an_extra(module: str) -> None:
    """pip's name of each, with the range of its versions, stands in host/pyproject.toml."""
    declared = (ROOT / "host" / "pyproject.toml").read_text(encoding="utf-8")
    for package in PACKAGES[module].split():
        assert f'"{package}>=' in declared


def test_no_page_or_message_installs_pvid_from_a_registry_where_it_is_not() -> None:
    """The name would be anybody's to register."""
    wrong = re.compile(r"pip3? install[^\n`]*?(?<![\w./])'?pvid\b")
    for folder in ("host/src", "host/docs", "host/notebooks", "tools", "firmware", ".github"):
        for path in (ROOT / folder).rglob("*"):
            if path.suffix in (".py", ".md", ".ipynb", ".h", ".c", ".toml", ".yml", ""):
                if path.is_file() and (found := wrong.search(path.read_text(encoding="utf-8", errors="replace"))):
                    pytest.fail(f"{path.relative_to(ROOT)}: {found[0]}")
