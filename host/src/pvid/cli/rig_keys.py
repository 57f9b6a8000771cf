"""An option that is a key of the rig file: --l1 0.25 where --set l1=0.25 is meant."""

from __future__ import annotations

from dataclasses import fields

import click

from pvid.rig.file import Identifier, Nominal, RigFile, Sensor

_TABLES = {"sensor": Sensor, "nominal": Nominal, "identifier": Identifier}


def setting_for(error: click.NoSuchOption) -> str | None:
    """The sentence for an unknown option of a command with --set, if the rig file has a key of that name."""
    wanted = error.option_name.lstrip("-").replace("-", "_")
    has_settings = error.ctx is not None and any("--set" in one.opts for one in error.ctx.command.params)
    places = {one.name: one.name for one in fields(RigFile) if one.name not in _TABLES}
    places |= {one.name: f"{table}.{one.name}" for table, of in _TABLES.items() for one in fields(of)}
    if not has_settings or wanted not in places:
        return None
    return f"no option {error.option_name}: {wanted} is a key of the rig file: use --set {places[wanted]}=VALUE"
