"""The quick tests take 95 % of the core's branches."""

import subprocess
import sys

import pytest
from conftest import ROOT


@pytest.mark.long
def test_the_quick_tests_take_95_per_cent_of_the_branches() -> None:
    command = [sys.executable, "-P", str(ROOT / "tools" / "coverage.py")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=1500)
    assert done.returncode == 0, done.stdout[-6000:] + done.stderr[-2000:]
