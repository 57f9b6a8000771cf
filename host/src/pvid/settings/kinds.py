"""Type of the settings of an identifier of the strong form."""

from __future__ import annotations

from pvid.settings.f32 import StrongConfig
from pvid.settings.q31 import StrongConfigQ31

Settings = StrongConfig | StrongConfigQ31
