"""The two-link Kapitza pendulum: two links, the first hangs from a pivot that is driven vertically.

Scales. With y read (1 + g) times too large, u = y''/l1 and with it G = w + u is (1 + g) times too large. q = phi''/G is
then 1/(1 + g) of what it was, and q'' = -d1 phi'' - d2 G phi holds as before with

    w (1 + g),    d1 / (1 + g),    d2 / (1 + g)^2

in both forms: every run is explained as well as with the true parameters. An l1 that is (1 + e) times too long does
the same as g = -e, and besides stretches the lengths that are counted in it: g* = w l1 stays, l2 and rho2 do not.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from pvid.models.kapitza.physical import is_plausible, linear, physical, physical_gradient
from pvid.models.model import Channel, Constant, Constants, Float, Model, Parameter, Quantity, Scale


def _mapped_of(values: npt.ArrayLike, constants: Constants) -> Float:
    g, l2, rho2 = np.asarray(values, np.float64)
    return linear(g, l2, rho2, constants["l1"])


MODEL = Model(
    name="kapitza",
    title="two-link pendulum on a pivot that is driven vertically",
    channels=(
        Channel(
            "phi",
            "rad",
            "relative angle",
            short="angle",
            usual_names=r"phi|φ|angle|ang|theta|winkel|enc|deg|rad|pend|°",
        ),
        Channel(
            "y",
            "m",
            "height of the pivot",
            short="pivot",
            shown_in=("mm", 1e3),
            usual_names=r"^y$|^y[^a-z]|height|^h$|^h[^a-z]|pivot|cart|base|pos|disp|laser|dist|^z",
        ),
    ),
    constants=(Constant("l1", "m", "length of rod 1", example="0.25"),),
    parameters=(
        Parameter("w", "1/s^2", "g*/l1"),
        Parameter("d1", "", "1 + L2 (1 + L1)"),
        Parameter("d2", "", "L1 L2"),
        Parameter("c", "rad", "the encoder's zero", role="offset"),
        Parameter("c1", "m^2/s", "friction of the pivot over the mass of body 2", role="nuisance"),
        Parameter("c2", "m^2/s", "friction of the joint over the mass of body 2", role="nuisance"),
    ),
    physical=(
        Quantity("g", "m/s^2", "gravity in the plane", symbol="g*"),
        Quantity("l2", "m", "joint to centre of mass"),
        Quantity("rho2", "m", "radius of gyration"),
    ),
    physical_of=lambda p, constants: physical(p, constants["l1"]),
    gradient_of=lambda p, constants: physical_gradient(p, constants["l1"]),
    mapped_of=_mapped_of,
    is_plausible=is_plausible,
    scales=(
        Scale("y_gain", "sensor.y_gain_sd", "the gain of y", p=(1.0, -1.0, -2.0), physical=(0.0, 0.0, 0.0)),
        Scale("l1", "l1_sd", "l1", p=(-1.0, 1.0, 2.0), physical=(1.0, 1.0, 1.0)),
    ),
)
