"""Model files: ten lines; what is wrong in one is said in one sentence with file, line, symbol and cause."""

import ast
import re
import time
from pathlib import Path

import pytest
import sympy as sp

from bench.kinds import KINDS
from pvid.base.errors import PvidError
from pvid.codegen.build import files_of
from pvid.codegen.generated import GeneratedModel
from pvid.model import Integral, Model, cos, sgn, sin
from pvid.model.corners import OfInput, with_corners
from pvid.model.signals import Jet
from pvid.models.mechanisms import compiled_of, described, names

SHIPPED = {  # theta of each kind of row, unknowns
    "kapitza": ([8], 4),
    "dc_motor": ([4, 5], 7),
    "cart_pendulum": ([5, 4], 7),
    "furuta": ([4, 4], 6),
    "two_link_arm": ([6, 4], 8),
    "two_mass_drive": ([10], 8),
    "battery_2rc": ([7], 7),
    "rigid_body": ([5, 5, 5], 6),
    "ball_on_beam": ([2, 4], 5),
    "buck_converter": ([2, 3], 5),
    "coast_down": ([3], 3),
    "coasting_motor": ([3], 3),
    "cooling": ([2], 2),
    "first_order_step": ([6], 4),
    "free_pendulum": ([4], 4),
    "heater": ([3], 3),
    "mass_on_spring": ([5], 5),
    "mecanum": ([5, 5, 4], 6),
    "motor_speed": ([4, 5], 7),
    "pmsm": ([4, 5, 5], 8),
    "quadrotor_axis": ([4], 4),
    "rc_step": ([3], 3),
    "ring_down": ([3], 3),
    "rl_step": ([3], 3),
    "tank": ([3], 3),
    "thrust_stand": ([2, 4, 2], 7),
}


@pytest.mark.parametrize("name", names())
def test_shipped_mechanisms_have_few_theta_and_compile_in_no_time(name: str) -> None:
    model = described(name)
    began = time.process_time()
    compiled = model.compiled(name)
    assert time.process_time() - began < 2.0
    thetas, unknowns = SHIPPED[name]
    assert [len(row.theta) for row in compiled.rows] == thetas
    assert len(compiled.p) == unknowns
    assert compiled.name == name
    assert {*compiled.p_names, *(one.name for one in compiled.outputs)} <= compiled.meanings.keys()


@pytest.mark.parametrize("name", names())
def test_shipped_descriptions_are_short(name: str) -> None:
    text = (Path(__file__).parents[2] / "host/src/pvid/models" / name / "mechanism.py").read_text(encoding="utf-8")
    rows = text.partition("# The refinement")[0]
    lines = [line for line in rows.splitlines() if line and not line.startswith(("from", "import", '"""'))]
    assert len(lines) <= 20
    assert set(SHIPPED) == set(names())


def written(folder: Path, text: str) -> Path:
    path = folder / "mine.py"
    path.write_text("from pvid.model import *\nmodel = Model('mine')\n" + text, encoding="utf-8")
    return path


FINE_LINES = """x = model.sensor("x", "m", resolution=1e-4)
u = model.input("u", "N", hold="zoh")
m, b = model.unknown("m", "kg", 1.0), model.unknown("b", "N*s/m", 1.0)
"""
FINE_EQUATION = "model.equation(m * x.d(2) + b * x.d() - u)\n"


def test_a_users_file_is_compiled_by_its_name(tmp_path: Path) -> None:
    path = written(tmp_path, FINE_LINES + FINE_EQUATION)
    compiled = compiled_of(path)
    assert compiled.name == "mine"
    assert compiled_of(path) is compiled


def test_a_file_may_begin_with_a_byte_order_mark(tmp_path: Path) -> None:
    path = written(tmp_path, FINE_LINES + FINE_EQUATION)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert compiled_of(path).name == "mine"


def test_a_file_may_import_what_lies_beside_it(tmp_path: Path) -> None:
    (tmp_path / "masses_of_mine.py").write_text("GUESS = 1.5\n", encoding="utf-8")
    path = written(tmp_path, FINE_LINES + "from masses_of_mine import GUESS\n" + FINE_EQUATION)
    assert compiled_of(path).unknowns[0].guess == 1.0


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("model.equation(m * x.d(2) + b * x - u)", "mine.py, line 6: equation 1: the term b*x has the unit"),
        ("model.equation(m * x.d(2) + c * x.d() - u)", "mine.py, line 6: NameError: name 'c' is not defined"),
        ("del sgn; model.equation(m * sgn(x) - u)", "name 'sgn' is not defined; add `from pvid.model import sgn`"),
        ("model.equation(m * x.d(2) +)", "mine.py, line 6: invalid syntax"),
        ("import sympy; model.equation(m * x.d(2) - u + sympy.Symbol('k') * x)", "line 6: k is not declared"),
        ("model.unknown('m', 'kg', 1.0)", "line 6: m is declared twice"),
        ("model.unknown('x_2', 'kg', 1.0)", "line 6: x_2 is declared twice, or is the name of a derivative"),
        ("model.unknown('k', 'N/m', -1.0)", "line 6: k: the guess -1.0 is not positive"),
        ("model.unknown('k', 'N/m', 0.0, positive=False)", "line 6: k: with a guess of 0, give sd"),
        ("model.input('v', 'V', hold='zoh', gain_sd=1)", "line 6: v: gain_sd is a relative standard deviation"),
        ("model.unknown('k', 'N/m', 'big')", "line 6: TypeError"),
        ("model.unknown('2k', 'N/m', 1.0)", "line 6: '2k' is no name"),
        ("model.unknown('t', 'N/m', 1.0)", "line 6: t is the time"),
        ("model.sensor('y', 'm')", "line 6: y: give its resolution or its noise"),
        ("model.input('v', 'V', hold='first')", 'line 6: v: hold is "first"'),
        ("model.equation(m * b)", "line 6: equation 1 contains no signal"),
        ("model.lagrange(m * x.d()**2 / 2, [x], [])", "line 6: lagrange: 1 coordinates but 0 generalised forces"),
        ("model.output('z', 'm', x)", "line 6: the output z contains a signal"),
        ("model.equation(m * x.d(9) - u)", "line 6: derivative 9 of x would be needed: at most 8"),
        ("model = 3", "the file leaves no pvid.model.Model in a variable `model`"),
        (
            "a = model; model = Model('2'); b = Model('3'); del model",
            "the file leaves 2 models and none of them in a var",
        ),
        ("", "mine: the model has no equation"),
        ("import sympy; model.equation(b * sympy.exp(x * b) - u)", "line 6: equation 1"),
        ("model.equation(m * sgn(b) * x.d(2) - u)", "line 6: sgn(b) is not supported: make it the unknown itself"),
        ("model.equation(m * x.d(2) - u * (b / b) ** 0.5 - u * abs(x) ** 0.5)", "line 6: equation 1"),
        ("raise SystemExit(3)", "line 6: SystemExit"),
        ("raise ValueError('two\\nlines')", "line 6: ValueError: two lines"),
        ("import nothing_of_this_name", "line 6: ModuleNotFoundError"),
    ],
)
def test_errors_name_line_symbol_and_cause(tmp_path: Path, line: str, said: str) -> None:
    with pytest.raises(PvidError) as caught:
        compiled_of(written(tmp_path, FINE_LINES + line + "\n"))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_only_model_of_a_file_may_have_any_name(tmp_path: Path) -> None:
    compiled = compiled_of(written(tmp_path, FINE_LINES + FINE_EQUATION + "rig = model\ndel model\n"))
    assert [unknown.name for unknown in compiled.unknowns] == ["m", "b"]


def test_names_that_are_no_model_are_refused_with_the_list() -> None:
    with pytest.raises(PvidError, match="no such model; give a .py file or one of ball_on_beam, battery_2rc"):
        compiled_of("dc-motor")


def small() -> tuple[Model, Jet, Jet]:
    model = Model("small")
    return model, model.sensor("x", "", noise=0.1), model.input("u", "", hold="zoh")


def test_floats_become_the_decimal_fractions_that_they_are_written_as() -> None:
    model, x, u = small()
    a, b = model.unknown("a", "s^2", 1.0), model.unknown("b", "", 1.0)
    model.equation(a * x.d(2) + 9.81 * b * sin(x) + 0.1 * b * x - u)
    (row,) = model.compiled().rows
    assert row.regressors[1] == {0: sp.Rational(981, 100) * sin(x) + x / 10}


def test_an_offset_inside_a_sine_leaves_it() -> None:
    model, x, u = small()
    a, c = model.unknown("a", "", 1.0), model.unknown("c", "", 0.1, positive=False)
    model.equation(a * sin(2 * x - c) - u)
    (row,) = model.compiled().rows
    found = dict(zip(row.theta, row.regressors, strict=True))
    assert found == {a * cos(c): {0: sin(2 * x)}, a * sin(c): {0: -cos(2 * x)}}


def test_rational_functions_absolute_values_and_signs() -> None:
    model, x, u = small()
    a, b, c = (model.unknown(name, unit, 1.0) for name, unit in (("a", "s^2"), ("b", "s^2"), ("c", "")))
    model.equation(a * x.d(2) / (1 + x**2) + b * abs(x.d()) * x.d() + c * sgn(-2 * x.d()) - u)
    (row,) = model.compiled().rows
    found = dict(zip(row.theta, row.regressors, strict=True))
    assert found[b] == {0: sp.Abs(x.d()) * x.d()}
    assert found[c] == {0: -sgn(x.d())}
    assert found[a][1] == x.d() / (1 + x**2)


def test_an_unknown_beside_a_signal_in_a_denominator_is_multiplied_out() -> None:
    model, x, u = small()
    a, w = model.unknown("a", "", 1.0), model.unknown("w", "", 1.0)
    model.equation(a * x / (w + u) - u)
    (row,) = model.compiled().rows
    assert dict(zip(row.theta, row.regressors, strict=True)) == {a: {0: x}, w: {0: -u}}
    assert row.known == {0: u**2}


def test_equations_may_be_written_as_eq_or_as_a_matrix() -> None:
    rows = []
    for form in ("expressions", "equalities", "matrix"):
        model, x, u = small()
        a, b = model.unknown("a", "s^2", 1.0), model.unknown("b", "s", 1.0)
        if form == "matrix":
            model.equation(sp.Matrix([a * x.d(2) - u, b * x.d() - u]))
        else:
            for left in (a * x.d(2), b * x.d()):
                model.equation(sp.Eq(left, u) if form == "equalities" else left - u)
        rows.append(model.compiled().rows)
    assert rows[0] == rows[1] == rows[2]


def test_known_constants_share_a_coefficient_and_keep_their_names() -> None:
    """The arm's h2 multiplies three channels by known lengths and gravity: one theta."""
    compiled = compiled_of("two_link_arm")
    h2 = next(one.symbol for one in compiled.unknowns if one.name == "h2")
    part = dict(zip(compiled.rows[0].theta, compiled.rows[0].regressors, strict=True))[h2]
    assert sorted(part) == [0, 1, 2]
    assert {str(one) for one in compiled.with_knowns(part[0]).free_symbols} == {"q1", "q2"}


def test_an_integral_since_the_start_is_a_signal_of_the_rows() -> None:
    compiled = compiled_of("battery_2rc")
    z, i = Jet("z"), Jet("i")
    assert compiled.opaque == {z: Integral(i, 1)}
    assert z.d() - i in compiled.equations
    assert z in compiled.hidden
    psis = [psi for part in compiled.rows[0].regressors for psi in part.values()]
    assert not any(jet.of == "z" and jet.order for psi in psis for jet in psi.atoms(Jet))


def test_variants_move_a_derivative_to_the_test_function() -> None:
    model = Model("alternatives")
    x, a, u = (model.sensor(name, "", noise=0.1) for name in ("x", "a", "u"))
    b = model.unknown("b", "s", 1.0)
    model.equation(b * cos(a) * x.d() - u)
    variants = model.compiled_variants()
    assert set(variants) == {"", "x"}
    assert variants[""].rows[0].regressors == ({0: cos(a) * x.d()},)
    assert variants["x"].rows[0].regressors == ({1: x * cos(a), 0: x * a.d() * sin(a)},)


def test_corners_of_the_current_are_channels_of_the_motor_and_of_no_other() -> None:
    for name in KINDS:
        model, jumps = with_corners(compiled_of(name))
        assert jumps == ({"V_jump": OfInput("V", "jump")} if name == "dc_motor" else {})
        if name != "dc_motor":
            assert model is compiled_of(name)
    motor, _ = with_corners(compiled_of("dc_motor"))
    jump = Jet("V_jump")
    first, second = (dict(zip(map(str, row.theta), row.regressors, strict=True)) for row in motor.rows)
    assert first["R/L"] == {0: jump}
    assert second["k/L"] == {0: -jump}
    assert motor.rows[0].known == {0: Jet("V"), 1: -jump}


OPENING = "from math import cosh\nimport math\nimport numpy as np\nfrom sympy import Heaviside, Max, Min, Piecewise\n"


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("model.equation(x / 0 - u)", "-u + zoo*x is not finite: is something divided by 0?"),
        ("model.equation(m * x.d(2) + float('inf') * x - u)", "is not finite: is something divided by 0?"),
        ("model.output('q', 'kg', m / 0)", "zoo*m is not finite: is something divided by 0?"),
        ("model.equation(m * math.sin(x) - u)", "math.sin takes numbers: use sin of pvid.model"),
        ("model.equation(m * np.cos(x) - u)", "np.cos takes numbers: use cos of pvid.model"),
        ("model.equation(m * np.exp(x) - u)", "np.exp takes numbers: use sin, cos, sgn (or the built-in abs)"),
        ("model.equation(m * cosh(x) - u)", "a function of math or numpy takes numbers: use sin, cos"),
        ("model.equation(m * Max(x, 0) - u)", "Max is not supported: max(a, b) is (a + b + abs(a - b))/2"),
        ("model.equation(m * Min(x, 0) - u)", "Min is not supported: min(a, b) is (a + b - abs(a - b))/2"),
        ("model.equation(m * Piecewise((x, x > 0), (0, True)) - u)", "Piecewise is not supported: (1 + sgn(x))/2 is 1"),
        ("model.equation(m * Heaviside(x) - u)", "Heaviside is not supported: (1 + sgn(x))/2 is 1"),
        ("model.output('q\\n', 'kg', m)", "is no name: letters, digits and _ after a letter"),
        ("model.sensor('y\\n', 'm', resolution=1)", "is no name: letters, digits and _ after a letter"),
        ("model = Model(3)", "the title 3 is no text"),
    ],
)
def test_what_is_no_equation_of_signals_is_named_with_its_line(tmp_path: Path, line: str, said: str) -> None:
    with pytest.raises(PvidError) as refused:
        compiled_of(written(tmp_path, OPENING + FINE_LINES + line + "\n"))
    assert said in str(refused.value) and str(refused.value).startswith("mine.py, line 10: ")


TITLES = [
    "*/ int evil; /*",
    '""" + evil() + """',
    "a\nint evil;\r\nb",
    "nul\0\x1b[31m",
    "a */*/ b /*/* c",
    "ends in \\",
    "ends in ??/",
    '"); $(shell,evil) ${evil} $ENV{evil} {0} `evil`',
    "<b>&amp;\u202eevil</b>",
]


@pytest.mark.parametrize("title", TITLES)
def test_a_title_ends_no_comment_and_no_string_of_what_is_generated(title: str) -> None:
    model = Model(title)
    x = model.sensor("x", "m", resolution=1e-4)
    u, m = model.input("u", "N", hold="zoh"), model.unknown("m", "kg", 1.0)
    model.equation(m * x.d(2) - u)
    for name, text in files_of(GeneratedModel(model.compiled("mine"), "pvid model build mine")).items():
        if name.endswith(".py"):
            text = ast.unparse(ast.parse(text).body[1:])  # type: ignore[arg-type]
        else:
            text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        assert "evil" not in text.replace("# pvid", "") and "*/" not in text and "/*" not in text, name
    assert model.title.isprintable() and not set('"\\$`{}') & set(model.title)
    assert Model("Motor, Kt = Ke: 20 % (ünïcode)").title == "Motor, Kt = Ke: 20 % (ünïcode)"


def test_a_model_of_the_librarys_name_is_not_built(tmp_path: Path) -> None:
    path = written(tmp_path, FINE_LINES + FINE_EQUATION).rename(tmp_path / "pvid.py")
    assert compiled_of(path).name == "pvid"
    with pytest.raises(PvidError, match="pvid is the library's name, whose macros the C of this model"):
        files_of(GeneratedModel(compiled_of(path), "a command"))


def test_the_root_of_a_measured_level_is_a_channel_and_that_of_a_hidden_one_is_refused() -> None:
    (row,) = compiled_of("tank").rows
    h = Jet("h")
    roots = [part[0] for part in row.regressors if 0 in part and part[0].has(h)]
    assert any(one.has(sp.sqrt(sp.Abs(h))) for one in roots)
    model = Model("two tanks")
    q, low = model.input("q", "m^3/s", hold="zoh"), model.sensor("low", "m", resolution=1e-3)
    high = model.unmeasured("high", "m")
    A, a = model.unknown("A", "m^2", 0.02), model.unknown("a", "m^2", 1e-4)
    g = model.known("g", "m/s^2", 9.81)
    model.equation(A * high.d() + a * sp.sqrt(g * high) - q)
    model.equation(A * low.d() - a * sp.sqrt(g * high))
    with pytest.raises(PvidError, match="high cannot be eliminated"):
        model.compiled()
