"""Compiled models written by hand: every kind of input, operation and column that a compiler can make."""

import sympy as sp

from pvid.model.compiled import CompiledModel, Known, Row, Signal, Unknown
from pvid.model.signals import TIME, Integral, Jet, sgn

V, CURRENT, PHI = Jet("V"), Jet("i"), Jet("phi")
R, L, K, J, C = sp.symbols("R L k J c", real=True)
G = sp.Symbol("g", real=True)


def unknown(symbol: sp.Symbol, guess: float, low: float, high: float, positive: bool = True) -> Unknown:
    return Unknown(symbol, "", guess, positive, low, high, 1.0)


SIGNALS = (
    Signal(V, "V", "input", reach=12, hold="zoh", driven=True),
    Signal(CURRENT, "A", "sensor", resolution=5e-3, reach=5),
    Signal(PHI, "rad", "sensor", resolution=1e-3, reach=100),
)

# Two kinds of rows that share k; a sign, a sine of a multiple, a product of derivatives, a known constant.
MOTOR = CompiledModel(
    "motor",
    "motor with a pendulum on its shaft",
    SIGNALS,
    (
        unknown(R, 1.2, 0.1, 10),
        unknown(L, 3e-3, 3e-4, 3e-2),
        unknown(K, 0.05, 0.005, 0.5),
        unknown(J, 2e-4, 2e-5, 2e-3),
        unknown(C, 0.1, -1.5, 1.5, False),
    ),
    (Known(G, "m/s^2", 9.81),),
    (),
    (
        Row("voltage", (R, L, K), ({0: CURRENT}, {1: CURRENT}, {1: PHI}), {0: V}),
        Row(
            "torque",
            (K, J, G * sp.cos(C) * J / (L + R), sp.sin(C) ** 3 / R**2),
            (
                {0: -CURRENT},
                {2: PHI},
                {0: sp.sin(2 * PHI) / (3 + sp.cos(PHI)) - sp.Rational(2, 3) * sgn(PHI.d())},
                {0: PHI.d() ** 3 * sp.cos(PHI) - PHI.d() * CURRENT * sp.Abs(PHI.d()), 1: sp.tan(PHI / 200) * sp.pi},
            ),
            {},
        ),
    ),
)

# Running integrals, the time, columns that are free in each window, an auxiliary signal; names that C reserves.
DOUBLE = Jet("double")
P, OUT = sp.symbols("p out", real=True)
CHAIN = CompiledModel(
    "chain",
    "hidden coordinate",
    (Signal(DOUBLE, "m", "input", reach=2), Signal(PHI, "rad", "sensor", resolution=1e-3, reach=0.5)),
    (unknown(P, 30.0, 3, 300), unknown(OUT, 9.0, 1, 90)),
    (),
    (),
    (
        Row(
            "chain",
            (P, P * OUT, -P * OUT**2),
            ({2: DOUBLE * Integral(PHI, 2)}, {0: PHI, 2: DOUBLE * Integral(DOUBLE * PHI, 2)}, {1: Jet("s")}),
            {4: -PHI},
            ({2: DOUBLE}, {2: DOUBLE * TIME}),
        ),
    ),
    opaque={Jet("s"): sgn(PHI.d())},
)

# Names that mean something in C, C++, Python or the generated files.
NAMES = """
y1 j0 gamma index time exp row limits sin cos main bool signal abs np Scaled elementary elementary_q31 v0 w1 in out
""".split()
_SIGNALS = [Jet(name) for name in NAMES[:12]]
_UNKNOWNS = [sp.Symbol(name, real=True) for name in NAMES[12:]]
ODDLY_NAMED = CompiledModel(
    "double",
    "names",
    tuple(Signal(jet, "", "sensor", resolution=1e-3) for jet in _SIGNALS),
    tuple(unknown(one, 1.0, 0.1, 10.0) for one in _UNKNOWNS),
    (),
    (),
    (
        Row(
            "row",
            tuple(one * _UNKNOWNS[k - 1] + one for k, one in enumerate(_UNKNOWNS)),
            tuple({0: _SIGNALS[k] * _SIGNALS[k - 1]} for k, _ in enumerate(_UNKNOWNS)),
            {0: _SIGNALS[-1]},
        ),
    ),
)
