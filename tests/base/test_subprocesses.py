"""Emulators belong to the program that started them: it alone gets Ctrl-C, and none is left behind."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from logs import samples_in
from processes import PATIENCE_S, children_of, until

from pvid.board.target import HOST_TARGET
from pvid.log.reader import LogReader
from pvid.rig.mechanism_file import MechanismRig


def runs(pid: int) -> bool:
    """Whether there is such a process and it has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


@pytest.fixture
def logger(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    """`pvid log` of this machine's build in a process group of its own, as a shell would start it; it has recorded."""
    MechanismRig("kapitza", 1000.0, known={"l1": 0.3}).write(tmp_path / "rig.toml")
    command = [sys.executable, "-m", "pvid", "log", HOST_TARGET, "a.pvlog", "--rig", "rig.toml"]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    until(lambda: samples_in(tmp_path / "a.pvlog") > 500 or process.poll() is not None)
    yield process
    process.kill()
    process.communicate()


def test_ctrl_c_ends_the_recording_and_not_the_emulator_before_it(
    tmp_path: Path, logger: subprocess.Popen[str]
) -> None:
    """A terminal sends its SIGINT to the whole group; an emulator that got it would be gone before the recording."""
    (emulator,) = children_of(logger.pid)
    os.killpg(logger.pid, signal.SIGINT)
    out, err = logger.communicate(timeout=PATIENCE_S)
    assert logger.returncode == 0, err
    assert "ended by SIGINT" in out and "gone" not in out
    assert not runs(emulator)
    reader = LogReader(tmp_path / "a.pvlog")
    assert list(reader) and reader.account.lost_share == 0


def test_a_killed_recording_leaves_no_emulator_behind(tmp_path: Path, logger: subprocess.Popen[str]) -> None:
    (emulator,) = children_of(logger.pid)
    logger.kill()
    logger.communicate(timeout=PATIENCE_S)
    until(lambda: not runs(emulator))
    reader = LogReader(tmp_path / "a.pvlog")
    assert list(reader) and reader.account.samples > 500 and reader.account.lost_share == 0
