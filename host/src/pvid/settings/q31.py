"""Settings of the parts of a fixed-point identifier."""

from __future__ import annotations

from pvid.settings.parts import EstimatorConfigQ31 as EstimatorConfigQ31
from pvid.settings.parts import GateConfigQ31 as GateConfigQ31
from pvid.settings.parts import TrustConfigQ31 as TrustConfigQ31
