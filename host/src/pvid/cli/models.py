"""`pvid models`."""

from __future__ import annotations

import click
from rich.console import Console

from pvid.base.console import DONE


@click.command(name="models")
def command() -> int:
    """Lists each mechanism: its channels, constants, estimated parameters and physical parameters, with units."""
    from pvid.show.models_table import models_table

    Console().print(models_table())
    return DONE
