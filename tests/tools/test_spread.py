"""Tests in several processes: each test runs once, and no failure is lost."""

import subprocess
import sys
from pathlib import Path

from pvid.core.sources import ROOT

CONFTEST = """
import pytest
from spread import run

@pytest.hookimpl(tryfirst=True)
def pytest_runtestloop(session):
    run(session, 2)
    return True

@pytest.fixture(scope="module")
def file():
    yield "open"
    print("closed")
"""
GOOD = """
import warnings

def test_of_a_fixture(file, tmp_path):
    assert file == "open" and tmp_path.is_dir()

def test_with_a_warning():
    warnings.warn("beware")

def test_of_output(capfd):
    print("a line")
    assert capfd.readouterr().out == "a line\\n"
"""
WRONG = "def test_wrong():\n    print('shown')\n    assert 1 == 2\n"
ENDS = "import os\n\ndef test_ends():\n    os._exit(3)\n\ndef test_behind():\n    pass\n"


def _run(folder: Path, *options: str, **files: str) -> str:
    (folder / "conftest.py").write_text(files.pop("conftest", CONFTEST))
    for name, text in files.items():
        (folder / f"test_{name}.py").write_text(text)
    code = f"import sys, pytest; sys.path.append({str(ROOT / 'tests')!r}); sys.exit(pytest.main())"
    words = [sys.executable, "-c", code, "-p", "no:cacheprovider", "-p", "no:hypothesispytest", *options]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False, timeout=120)
    return f"{done.stdout}{done.stderr}exit {done.returncode}"


def test_every_test_runs_once_and_warnings_are_shown(tmp_path: Path) -> None:
    many = {f"good_{k}": GOOD for k in range(5)}
    found = _run(tmp_path, **many)
    assert "15 passed, 5 warnings" in found and "beware" in found and found.endswith("exit 0")


def test_a_failure_is_shown_and_a_process_that_ends_is_one(tmp_path: Path) -> None:
    found = _run(tmp_path, good=GOOD, wrong=WRONG, ends=ENDS)
    assert "assert 1 == 2" in found and "shown" in found
    assert "test_ends.py::test_ends - its process ended with 3" in found.replace("FAILED ", "")
    assert "test_behind - not run: its process ended before" in found
    assert "3 failed, 3 passed" in found and found.endswith("exit 1")


def test_the_error_that_ends_a_process_is_shown(tmp_path: Path) -> None:
    found = _run(tmp_path, stops="import pytest\n\ndef test_stops():\n    pytest.exit('no more')\n", good=GOOD)
    assert "Exit: no more" in found and "1 failed, 3 passed" in found and found.endswith("exit 1")


def test_an_error_of_the_process_that_collects_ends_all(tmp_path: Path) -> None:
    """Reports that it has not read are larger than a pipe."""
    large = "import pytest\n\n@pytest.mark.parametrize('k', range(20))\ndef test_large(k):\n"
    large += "    print('x' * 20_000)\n    assert 0\n"
    raising = CONFTEST + "\ndef pytest_runtest_logreport(report):\n    import os\n    assert os.getpid() != first\n"
    raising += "\nimport os\nfirst = os.getpid()\n"
    found = _run(tmp_path, conftest=raising, one=large, other=large)
    assert found.endswith("exit 3")


def test_after_the_first_failure_no_further_file_is_begun(tmp_path: Path) -> None:
    many = {f"wrong_{k}": WRONG for k in range(50)}
    found = _run(tmp_path, "-x", **many)
    failed = int(found.rpartition(" failed")[0].rpartition(" ")[2])
    assert 1 <= failed < 50 and found.endswith("exit 1") or "exit 2" in found
