"""The shell completes commands, options and mechanisms; what is nearly a command is proposed."""

import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner
from program import pvid

from pvid.cli.main import commands
from pvid.models.registry import names

PVID = [sys.executable, "-P", "-m", "pvid"]


def completed(line: str, **shell: str) -> list[str]:
    """What bash offers behind a line; the last word is incomplete."""
    environment = {"_PVID_COMPLETE": "bash_complete", "COMP_WORDS": line, "COMP_CWORD": str(len(line.split(" ")) - 1)}
    done = subprocess.run(PVID, env={**environment, **shell}, capture_output=True, text=True, check=False)
    assert done.stderr == ""
    return done.stdout.splitlines()


def test_commands_options_and_mechanisms_are_completed() -> None:
    assert completed("pvid ide") == ["plain,identify"]
    assert completed("pvid identify --val") == ["plain,--validate"]
    assert completed("pvid model ch") == ["plain,check"]
    assert completed("pvid identify run.csv --model dc") == ["plain,dc_motor", "file,dc"]
    assert set(completed("pvid plot run.csv --model ")) == {"file,", *(f"plain,{name}" for name in names())}


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_there_is_a_line_for_each_shell(shell: str) -> None:
    done = subprocess.run(PVID, env={"_PVID_COMPLETE": f"{shell}_source"}, capture_output=True, text=True, check=False)
    assert f"_PVID_COMPLETE={shell}_complete" in done.stdout and done.stderr == ""


def test_what_is_nearly_a_command_is_proposed() -> None:
    near = CliRunner().invoke(commands, ["identifx", "run.csv"])
    assert near.exit_code == 2 and "there is no command 'identifx': did you mean identify?" in near.stderr
    far = CliRunner().invoke(commands, ["qqq"])
    assert far.exit_code == 2 and "there is no command 'qqq'" in far.stderr and "mean" not in far.stderr


def test_the_nearest_option_alone_is_proposed(tmp_path: Path) -> None:
    near = pvid(tmp_path, "identify", "run.csv", "--modle", "dc_motor")
    assert "No such option '--modle'. Did you mean '--model'?" in near.stderr


def test_what_a_missing_option_can_be_stands_in_its_sentence(tmp_path: Path) -> None:
    missing = pvid(tmp_path, "deploy", "dc_motor", "-o", "x")
    assert "Missing option '--for'. Choose from: arduino, platformio, esp-idf" in missing.stderr
