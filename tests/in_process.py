"""The command in this process."""

from pathlib import Path

from click.testing import CliRunner, Result

from pvid.cli.main import commands


def pvid(*arguments: str | Path) -> Result:
    """`pvid ARGUMENTS`; a refusal raises."""
    return CliRunner().invoke(commands, [str(one) for one in arguments], catch_exceptions=False, standalone_mode=False)
