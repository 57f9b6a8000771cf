"""Type of the settings of any identifier."""

from __future__ import annotations

from pvid.settings.f32 import StrongConfig, WeakConfig
from pvid.settings.q31 import StrongConfigQ31, WeakConfigQ31

FloatSettings = WeakConfig | StrongConfig
FixedSettings = WeakConfigQ31 | StrongConfigQ31
Settings = FloatSettings | FixedSettings
