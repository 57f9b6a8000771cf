"""The standard rig's file for runs of its linear equations, which have no sines to correct."""

from __future__ import annotations

from dataclasses import replace

from pvid.rig.file import RigFile

_STANDARD = RigFile.standard()
LINEAR_RIG = replace(_STANDARD, identifier=replace(_STANDARD.identifier, full_angle=False))
