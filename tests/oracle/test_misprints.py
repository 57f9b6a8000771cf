"""The misprints of the paper (theory.md 3), each with a proof: the correction holds, the print does not.

The eliminated equation is derived here from the equations of motion (1); nothing is taken from theory.md but
the statements under test.
"""

import pytest
import sympy as sp

t = sp.Symbol("t", real=True)
l1, l2, rho2, w = sp.symbols("l1 l2 rho2 w", positive=True)
phi, u = (sp.Function(name)(t) for name in ("phi", "u"))

G = w + u
LAMBDA1 = l1 / l2
LAMBDA2_SQUARED = (l2 / rho2) ** 2
D1 = 1 + LAMBDA2_SQUARED * (1 + LAMBDA1)
D2 = LAMBDA1 * LAMBDA2_SQUARED

# Derivatives as free symbols: an identity in them is an identity along every motion, since the initial values
# and the drive are arbitrary.
F = sp.symbols("phi0:5")
U = sp.symbols("u0:3")
d1, d2 = sp.symbols("d1 d2", positive=True)
G0 = w + U[0]


def d(expression: sp.Expr, order: int) -> sp.Expr:
    return sp.diff(expression, t, order) if order else expression


def with_symbols(expression: sp.Expr) -> sp.Expr:
    """phi^(k), u^(k) as the symbols F[k], U[k], highest order first."""
    for order in range(4, -1, -1):
        expression = expression.subs(d(phi, order), F[order])
    for order in range(2, -1, -1):
        expression = expression.subs(d(u, order), U[order])
    return expression


def eliminated_from_the_motion() -> sp.Expr:
    """Equation (1) without phi1, times G^3: an expression that vanishes along every motion."""
    # phi'' = G phi1 - lambda2^2 (1 + lambda1) G phi, solved for phi1:
    hidden = phi.diff(t, 2) / G + LAMBDA2_SQUARED * (1 + LAMBDA1) * phi
    acceleration = -G * hidden + LAMBDA2_SQUARED * G * phi
    return sp.expand(sp.simplify(with_symbols((hidden.diff(t, 2) - acceleration).doit() * G**3)))


@pytest.fixture(scope="module")
def truth() -> sp.Expr:
    return eliminated_from_the_motion()


def in_link_lengths(expression: sp.Expr) -> sp.Expr:
    return expression.subs({d1: D1, d2: D2})


def same(left: sp.Expr, right: sp.Expr) -> bool:
    return bool(sp.simplify(sp.expand(left - right)) == 0)


def eliminated(second: sp.Expr, third: sp.Expr) -> sp.Expr:
    """G^2 phi'''' - 2 G (second) + [2 u'^2 - G u'' + d1 G^3] (third) + d2 G^4 phi."""
    bracket = 2 * U[1] ** 2 - G0 * U[2] + d1 * G0**3
    return in_link_lengths(G0**2 * F[4] - 2 * G0 * second + bracket * third + d2 * G0**4 * F[0])


def test_1_eliminated_equation(truth: sp.Expr) -> None:
    assert same(eliminated(second=U[1] * F[3], third=F[2]), truth)
    # Printed: -2 (omega^2 + u) phi'' and the bracket times phi'; each of the two is wrong by itself.
    assert not same(eliminated(second=F[2], third=F[1]), truth)
    assert not same(eliminated(second=F[2], third=F[2]), truth)
    assert not same(eliminated(second=U[1] * F[3], third=F[1]), truth)


THETA = (w, w**2, d1, d1 * w, d1 * w**2, d1 * w**3, d2, d2 * w, d2 * w**2, d2 * w**3, d2 * w**4)
Y = U[0] ** 2 * F[4] - 2 * U[0] * U[1] * F[3] + (2 * U[1] ** 2 - U[0] * U[2]) * F[2]
N = (
    -2 * U[0] * F[4] + 2 * U[1] * F[3] + U[2] * F[2],
    -F[4],
    -(U[0] ** 3) * F[2],
    -3 * U[0] ** 2 * F[2],
    -3 * U[0] * F[2],
    -F[2],
    -(U[0] ** 4) * F[0],
    -4 * U[0] ** 3 * F[0],
    -6 * U[0] ** 2 * F[0],
    -4 * U[0] * F[0],
    -F[0],
)


def model(y: sp.Expr, n: tuple[sp.Expr, ...]) -> sp.Expr:
    """Y - N^T theta, which must vanish where the eliminated equation does."""
    return in_link_lengths(y - sum(a * b for a, b in zip(n, THETA, strict=True)))


def test_2_output_has_the_third_derivative(truth: sp.Expr) -> None:
    assert same(model(Y, N), truth)
    printed = Y.subs(F[3], F[2])  # the middle term printed as -2 u u' phi''
    assert not same(model(printed, N), truth)


@pytest.mark.parametrize(
    ("entry", "printed"),
    [
        (1, -2 * U[0] * F[4] + 2 * U[1] * F[2] + U[2] * F[2]),
        (4, -3 * U[0] ** 2 * F[1]),
        (8, -4 * U[0] ** 3 * F[1]),
        (9, -6 * U[0] ** 2 * F[2]),
    ],
)
def test_3_regressor(truth: sp.Expr, entry: int, printed: sp.Expr) -> None:
    assert same(model(Y, N), truth)
    assert printed != N[entry - 1]
    as_printed = (*N[: entry - 1], printed, *N[entry:])
    assert not same(model(Y, as_printed), truth)


def test_4_pseudovelocities_are_rates() -> None:
    """C of the paper's (4) turns the RATES of theta_1, theta_3, theta_7 into d theta/dt, not their values."""
    estimate = [sp.Function(name)(t) for name in ("w", "d1", "d2")]
    theta = sp.Matrix([entry.subs(dict(zip((w, d1, d2), estimate, strict=True)), simultaneous=True) for entry in THETA])
    jacobian = theta.jacobian(estimate)
    first = [1, 2 * w, 0, d1, 2 * d1 * w, 3 * d1 * w**2, 0, d2, 2 * d2 * w, 3 * d2 * w**2, 4 * d2 * w**3]
    second = [0, 0, 1, w, w**2, w**3, 0, 0, 0, 0, 0]
    third = [0, 0, 0, 0, 0, 0, 1, w, w**2, w**3, w**4]
    printed_c = sp.Matrix([first, second, third]).T
    back = dict(zip(estimate, (w, d1, d2), strict=True))
    assert jacobian.subs(back) == printed_c
    chosen = sp.Matrix([theta[0], theta[2], theta[6]])
    assert sp.expand(jacobian * chosen.diff(t) - theta.diff(t)) == sp.zeros(11, 1)
    assert sp.expand(jacobian * chosen - theta.diff(t)) != sp.zeros(11, 1)


def test_5_link_ratios() -> None:
    theta = [in_link_lengths(entry) for entry in THETA]
    t2, t3, t7 = theta[1], theta[2], theta[6]
    assert same(t3 - t7 - 1, LAMBDA2_SQUARED)
    assert same(t7 / (t3 - t7 - 1), LAMBDA1)
    assert not same(t7 - t2 - 1, LAMBDA2_SQUARED)
    assert not same(t7 / (t7 - t2 - 1), LAMBDA1)
