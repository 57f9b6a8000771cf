"""An option that is a key of the rig file: --l1 0.25 where --set known.l1=0.25 is meant."""

from __future__ import annotations

import click

from pvid.models.mechanisms import described
from pvid.models.registry import names
from pvid.rig.mechanism_file import OF_THE_IDENTIFIER


def setting_for(error: click.NoSuchOption) -> str | None:
    """The sentence for an unknown option of a command with --set, if a rig file has a key of that name, or a shipped
    mechanism a constant."""
    wanted = error.option_name.lstrip("-").replace("-", "_")
    if error.ctx is None or not any("--set" in one.opts for one in error.ctx.command.params):
        return None
    places = {one.name: f"known.{one.name}" for name in names() for one in described(name).knowns}
    places |= {name: f"identifier.{name}" for name in OF_THE_IDENTIFIER}
    places |= {name: name for name in ("sample_rate", "clock_sd")}
    if wanted not in places:
        return None
    return f"no option {error.option_name}: {wanted} is a key of the rig file: use --set {places[wanted]}=VALUE"
