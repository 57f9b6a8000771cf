"""`pvid models`."""

from __future__ import annotations

import click
from rich.console import Console
from rich.table import Table

from pvid.base.console import DONE

# Until a mechanism has one description of its own, the pendulum's is put together here.
_CHANNELS = (("phi", "rad", "angle of the joint"), ("y", "m", "height of the pivot"))
_CONSTANTS = (("l1", "m", "length of rod 1"),)


@click.command(name="models")
def command() -> int:
    """Lists each mechanism: its channels, constants, estimated parameters and physical parameters, with units."""
    from pvid.log.values import PARAMETERS, PHYSICAL
    from pvid.log.words import PARAMETERS as MEANINGS

    table = Table("mechanism", "kind", "name", "unit", "meaning")
    rows = [("channel", *row) for row in _CHANNELS] + [("constant", *row) for row in _CONSTANTS]
    rows += [("parameter", name, unit, MEANINGS[name][1]) for name, unit in PARAMETERS.items()]
    rows += [("physical", name, unit, MEANINGS[name][1]) for name, unit in PHYSICAL.items()]
    for number, row in enumerate(rows):
        table.add_row("kapitza" if number == 0 else "", *row)
    Console().print(table)
    return DONE
