"""The refinement's functions: C and its twin have the same bits, values and derivatives are those of the equations."""

import ctypes
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
import sympy as sp
from conftest import ROOT

from bench.kinds import KINDS
from pvid.base.errors import PvidError
from pvid.codegen import files_refine
from pvid.codegen.refine import RefineFunctions, refine_functions, refine_functions_of
from pvid.core.host_compiler import host_compiler
from pvid.core.model_library import NATIVE, core_of, of_second_stage
from pvid.core.sources import FOLDERS, INCLUDES, source
from pvid.model import Model
from pvid.model.operations import Operation
from pvid.model.signals import Jet, sgn
from pvid.models.mechanisms import compiled_of
from pvid.models.simulated_rig import simulated_rig
from pvid.settings.cores import FLOAT
from pvid.twin.printer.program import printed_module

WARNINGS = ("-Werror", "-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wdouble-promotion", "-Wshadow")
VECTORS, PRINTED = 200, 40  # PRINTED: of the twin
# Names, and options of the refinement behind them.
NAMES = (*KINDS, "kapitza slant", "kapitza dry_friction slant")

Float = npt.NDArray[np.float64]
Given = dict[str, Any]


@cache
def functions(name: str) -> RefineFunctions:
    mechanism, *options = name.split()
    return refine_functions(compiled_of(mechanism).with_options(options))


@cache
def given_of(name: str) -> Given:
    """Parameters around the rig's own and states within reach, [entries, VECTORS]."""
    made, rng = functions(name), np.random.default_rng(5)
    truth = simulated_rig(name.split()[0]).truth
    near = [truth.get(one.name, 1.0 if one.sign else 0.0) for one in made.parameters]
    share = rng.uniform(0.9, 1.1, (len(near), VECTORS))
    r = np.array(near)[:, None] * share + np.where(np.array(near) == 0, 1e-2, 0)[:, None] * rng.normal(size=share.shape)
    n = len(made.coordinates)
    v = rng.uniform(-3, 3, (n if made.order == 2 else 0, VECTORS))
    q, u = (rng.uniform(-2, 2, (n, VECTORS)), rng.uniform(-5, 5, (len(made.inputs), VECTORS)))
    return {key: value.astype(np.float32) for key, value in dict(r=r, q=q, v=v, u=u).items()}


def sizes_of(made: RefineFunctions) -> dict[str, int]:
    """Entries of each array of the core's functions."""
    sizes = {key: n for one in made.functions.values() for key, n in (*one.given, *one.written)}
    tail = len(made.parameters) - made.moving
    return {"D": 0, "Zv": 0, **sizes, "Zr": len(made.outputs) * tail}


def arrays_of(made: RefineFunctions, name: str) -> tuple[list[str], list[str]]:
    """What a function of the core is given and writes."""
    given = [key for key, _ in made.functions[name].given if key != "row"]
    if name.startswith("output"):
        given.insert(1, "r")
    return given, list(files_refine.WRITTEN[name])


def wrapped(made: RefineFunctions) -> str:
    """C that exports a loop around each function."""
    sizes = sizes_of(made)
    lines = ['#include "refine_model_f32.h"']
    for name in made.functions:
        if name == "region":
            lines.append("void each_region(int n, float *r, _Bool *found);")
            lines.append("void each_region(int n, float *r, _Bool *found)")
            lines.append(f"{{ for (int k = 0; k < n; k++) found[k] = pvid_refine_region(&r[k * {sizes['r']}]); }}")
            continue
        entries = [one for group in arrays_of(made, name) for one in group]
        arguments = ", ".join(f"float *{key}" for key in entries)
        calls = ", ".join(f"&{key}[k * {sizes[key]}]" for key in entries)
        lines.append(f"void each_{name}(int n, {arguments});")
        lines.append(f"void each_{name}(int n, {arguments})")
        lines.append(f"{{ for (int k = 0; k < n; k++) pvid_refine_{name}({calls}); }}")
    return "\n".join(lines) + "\n"


class InC:
    """The printed header on this computer."""

    def __init__(self, made: RefineFunctions, folder: Path) -> None:
        self.made = made
        (folder / "pvid").mkdir()
        (folder / "pvid" / "refine_shape.h").write_text(files_refine.shape(made, "test"), encoding="utf-8")
        (folder / "refine_model_f32.h").write_text(files_refine.header(made, "test"), encoding="utf-8")
        (folder / "each.c").write_text(wrapped(made), encoding="utf-8")
        library = folder / "each.so"
        flags = ("-std=c99", "-O2", "-ffp-contract=off", *WARNINGS, "-shared", "-fPIC")
        sources = [str(folder / "each.c"), str(source("elementary_f32.c"))]
        command = [host_compiler("a test"), *flags, f"-I{folder}", *INCLUDES, *sources, "-o", str(library), "-lm"]
        subprocess.run(command, check=True)
        self.library = ctypes.CDLL(str(library))

    def __call__(self, name: str, given: Given) -> dict[str, npt.NDArray[np.float32]]:
        sizes = sizes_of(self.made)
        read, written = arrays_of(self.made, name)
        arrays = [np.ascontiguousarray(given[key].T) for key in read]
        out = {key: np.full((VECTORS, sizes[key]), np.nan, np.float32) for key in written}
        if name == "chart":
            out["row"] = np.ascontiguousarray(given["row"].T)
        pointers = (x.ctypes.data_as(ctypes.c_void_p) for x in (*arrays, *out.values()))
        self.library[f"each_{name}"](VECTORS, *pointers)
        return {key: value.T for key, value in out.items()}


@pytest.mark.parametrize("name", NAMES)
def test_c_and_its_printed_twin_have_the_same_bits(name: str, tmp_path: Path) -> None:
    """And the values of the lists in float64, to float32."""
    made = functions(name)
    in_c, given, sizes = InC(made, tmp_path), dict(given_of(name)), sizes_of(made)
    given["m"] = in_c("constants", given)["m"]
    given["row"] = np.random.default_rng(1).normal(size=(made.moving - made.skew, VECTORS)).astype(np.float32)
    assert np.isfinite(given["m"]).all()
    texts = {one: (tmp_path / one).read_text() for one in ("pvid/refine_shape.h", "refine_model_f32.h", "each.c")}
    twin = printed_module([source("elementary_f32.c")], FOLDERS, {}, [f"each_{one}" for one in made.functions], texts)
    for function in made.functions:
        if function == "region":
            continue
        got, (read, written) = in_c(function, given), arrays_of(made, function)
        out = {key: [np.float32(np.nan)] * (PRINTED * sizes[key]) for key in written}
        if function == "chart":
            out["row"] = list(given["row"][:, :PRINTED].T.ravel())
        with np.errstate(all="ignore"):
            flat = (list(given[key][:, :PRINTED].T.ravel()) for key in read)
            getattr(twin, f"each_{function}")(PRINTED, *flat, *out.values())
        wanted = made.functions[function].values(**given)
        for key, values in out.items():
            own = np.ascontiguousarray(got[key][:, :PRINTED].T)
            assert np.array(values, np.float32).tobytes() == own.tobytes(), key
            if key == "Zv" and np.isnan(got[key]).all():  # the core knows that no output depends on v
                assert not np.any(wanted.get(key, 0.0))
            elif key in wanted and key != "Zr":  # of which the core has the columns behind the motion's
                size = np.abs(wanted[key]).max(initial=1.0)
                np.testing.assert_allclose(got[key], wanted[key], rtol=1e-3, atol=1e-4 * size)
    given["r"] = given["r"].copy()
    given["r"][0, ::2] *= -1  # every model's first parameter is positive
    found = np.zeros(VECTORS, bool)
    arrays = np.ascontiguousarray(given["r"].T), found
    in_c.library.each_region(VECTORS, *(x.ctypes.data_as(ctypes.c_void_p) for x in arrays))
    assert not found[::2].any() and found[1::2].all()
    possible = [False] * PRINTED
    twin.each_region(PRINTED, list(given["r"][:, :PRINTED].T.ravel()), possible)
    assert possible == found[:PRINTED].tolist()


@pytest.mark.parametrize("name", NAMES)
def test_the_motion_solves_the_equations_of_the_description(name: str) -> None:
    """With values of float64 in the equations themselves, which the printer took apart."""
    made = functions(name)
    model = made.model
    given = {key: value.astype(np.float64) for key, value in given_of(name).items()}
    (given["m"],) = evaluated(made, "constants", given)
    (a,), (z,) = evaluated(made, "motion", given), evaluated(made, "output", given)
    own = model.refinement
    r = [sp.Symbol(one.name, real=True) for one in made.parameters]
    q = [jet for jet in _states(made) if jet.order == 0 or made.order == 1]
    values = dict(zip(r, given["r"], strict=True)) | dict(zip(q, given["q"], strict=True))
    values |= dict(zip(made.inputs, given["u"], strict=True))
    rates = dict(zip([jet.d() for jet in q], a, strict=True))
    if made.order == 2:
        values |= dict(zip([jet.d() for jet in q], given["v"], strict=True))
        rates = dict(zip([jet.d(2) for jet in q], a, strict=True))
    values |= {jet: value for jet, value in rates.items() if jet not in values}
    measured = {sp.Symbol(f"measured_{k}"): value for k, value in enumerate(z)}
    outputs = [own.outputs.get(one, Jet(one)) - mark for one, mark in zip(made.outputs, measured, strict=True)]
    algebraic = {Jet(one): mark for one, mark in zip(made.outputs, measured, strict=True) if Jet(one) not in values}
    widths = {one.sign: sp.Symbol(one.name, real=True) for one in made.parameters if one.sign}
    integrals = {jet.d() for jet in model.opaque}
    equations = [one for one in own.equations or model.equations if not one.free_symbols & integrals]
    for one in [*equations, *outputs]:
        soft = {sign: softened(sign.args[0], widths[str(sign.args[0])]) for sign in one.atoms(sgn)}
        plain = model.with_knowns(one.xreplace(soft).xreplace(own.shapes).xreplace(algebraic))
        symbols = sorted(plain.free_symbols, key=str)
        terms = [sp.lambdify(symbols, term) for term in sp.Add.make_args(sp.expand(plain))]
        at = [{**values, **measured}[symbol] for symbol in symbols]
        found = np.array([np.broadcast_to(term(*at), (VECTORS,)) for term in terms])
        assert (np.abs(found.sum(0)) <= 1e-12 * np.abs(found).sum(0)).all(), one


def softened(v: sp.Expr, width: sp.Symbol) -> sp.Expr:
    """The smooth replacement of sgn(v)."""
    return v / (v**4 + width**4) ** sp.Rational(1, 4)


def _states(made: RefineFunctions) -> list[Jet]:
    names = {one.name for one in made.model.signals} | {jet.of for jet in made.model.hidden} | set(made.coordinates)
    found = []
    for text in made.coordinates:
        of, _, order = text.rpartition("_")
        found.append(Jet(of, int(order)) if of in names and order.isdigit() else Jet(text))
    return found


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_finite_differences(name: str) -> None:
    """In float64, from each function's own list: central, to 2e-6 of the largest entry."""
    made = functions(name)
    inner = {key: value[:, :40].astype(np.float64) for key, value in given_of(name).items()}

    def values(function: str, at: Given) -> list[Float]:
        (m,) = evaluated(made, "constants", at)
        return evaluated(made, function, {**at, "m": m})

    names = [key for one in ("jacobian", "output_jacobian") for key, _ in made.functions[one].written]
    base = dict(zip(names, [*values("jacobian", inner), *values("output_jacobian", inner)], strict=True))
    np.testing.assert_allclose(base["a"], values("motion", inner)[0], rtol=1e-12, atol=1e-12)
    rows, moving = ({"motion": len(made.coordinates), "output": len(made.outputs)}, made.moving - made.skew)
    for function, key, got in (
        *(("motion", "q", "K"), ("motion", "v", "D"), ("motion", "u", "U"), ("motion", "r", "B")),
        *(("output", "q", "Zq"), ("output", "v", "Zv"), ("output", "r", "Zr")),
    ):
        entries = [k for k in range(len(inner[key])) if key != "r" or not made.skew or k != moving]
        if not entries or got not in base:
            continue
        slopes = []
        for entry in entries:
            log = key == "r" and made.parameters[entry].log
            ends = []
            for sign in (1, -1):
                moved = inner[key].copy()
                moved[entry] += sign * 1e-5 * (inner[key][entry] if log else 1.0)
                ends.append(values(function, {**inner, key: moved})[0])
            slopes.append((ends[0] - ends[1]) / 2e-5)
        wide = np.array(slopes).swapaxes(0, 1)  # [row, entry, vector]
        mine = base[got].reshape(rows[function], -1, wide.shape[-1])
        if got == "B":
            mine = base[got].reshape(moving, rows[function], -1).swapaxes(0, 1)
            mine, wide = charted(made, inner, mine), wide[:, :moving]
        elif got == "Zr":
            mine = np.concatenate([charted(made, inner, mine[:, :moving]), mine[:, moving:]], axis=1)
        scale = np.abs(wide).max(initial=1e-3)
        np.testing.assert_allclose(mine, wide, atol=2e-6 * scale, err_msg=f"{function} by {key}")


def charted(made: RefineFunctions, given: Given, by_motion: Float) -> Float:
    """Derivatives [rows, moving, vectors] by the motion's steps to those by the steps of r."""
    if "chart" not in made.functions:
        return by_motion
    return np.array([evaluated(made, "chart", {**given, "row": one})[0] for one in by_motion])


def evaluated(made: RefineFunctions, name: str, given: Given) -> list[Float]:
    """What a function writes, in float64."""
    return list(made.functions[name].values(**given).values())


def test_a_sign_may_have_constants_in_its_argument() -> None:
    """With the values of r and s, SymPy writes sgn((s w - v)/r) of a wheel as -sgn(20 v - 7 w)."""
    model = Model("wheel")
    tau, v, w = model.input("tau", "N*m", hold="zoh"), model.sensor("v", "m/s", 1e-3), model.sensor("w", "rad/s", 1e-3)
    r, s = model.known("r", "m", 0.05), model.known("s", "m", 0.35)
    m, jw, tc = model.unknown("m", "kg", 9.0), model.unknown("Jw", "kg*m^2", 1.0), model.unknown("Tc", "N*m", 0.1)
    turn = (s * w - v) / r
    model.equation(m * v.d() + (tau - tc * sgn(turn)) / r)
    model.equation(jw * w.d() - (tau - tc * sgn(turn)) * s / r)
    functions = refine_functions(model.compiled("wheel"))
    assert [one.sign for one in functions.parameters if one.sign] == ["(-v + w*s)/r"]


def test_the_pendulums_are_as_lean_as_those_by_hand() -> None:
    """The prototype's C has 41 operations in the accelerations, 122 with all derivatives."""
    made = functions("kapitza")
    counts = {name: one.program.operations for name, one in made.functions.items()}
    assert (counts["motion"], counts["jacobian"]) == (42, 125)
    divisions = [
        one for one in made.functions["jacobian"].program.values if isinstance(one, Operation) and one.kind == "/"
    ]
    assert len(divisions) == 1


def test_the_shipped_header_is_the_printed_one() -> None:
    done = subprocess.run(
        [sys.executable, ROOT / "tools" / "print_refine.py", "--check"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_the_width_of_a_sign_is_refined_where_it_is_not_given() -> None:
    motor = compiled_of("dc_motor")
    assert refine_functions_of(motor, {}).parameters[0].sign == "phi_1"
    assert not any(one.sign for one in refine_functions_of(motor, {"phi_1": 3.0}).parameters)


@pytest.mark.parametrize(
    ("name", "runge_kutta", "turning", "hidden"),
    [
        ("dc_motor", True, (False, True), 0),
        ("two_mass_drive", True, (True,), 1),
        ("cart_pendulum", True, (True, False), 0),  # gravity: the motion depends on the pendulum's angle
        ("battery_2rc", True, (False,), 2),
        ("rigid_body", False, (False,) * 3, 0),
        ("furuta", False, (False,) * 2, 0),
    ],
)
def test_how_a_motion_is_integrated(name: str, runge_kutta: bool, turning: tuple[bool, ...], hidden: int) -> None:
    """Friction and relaxations by Runge-Kutta; angles without whole turns where the motion does not depend on them."""
    made = functions(name)
    assert (made.runge_kutta, made.turning, made.hidden) == (runge_kutta, turning, hidden)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_held_input_that_may_jump_is_not_for_adams(smooth: bool) -> None:
    model = Model("test")
    F, x = model.input("F", "N", hold="zoh", smooth=smooth), model.sensor("x", "m", noise=1e-3)
    m, k = model.unknown("m", "kg", 1.0), model.unknown("k", "N/m", 1.0)
    model.equation(m * x.d(2) + k * x - F)
    made = refine_functions_of(model.compiled("test"), {})
    assert (made.runge_kutta, made.order) == ((False, 2) if smooth else (True, 1))


def test_the_description_of_a_refinement_is_checked() -> None:
    model = Model("test")
    F, x = model.input("F", "N", hold="zoh"), model.sensor("x", "m", noise=1e-3)
    m, k = model.unknown("m", "kg", 1.0), model.unknown("k", "N/m", 1.0)
    model.equation(m * x.d(2) + k * x - F)
    with pytest.raises(PvidError, match="sd must be positive"):
        model.refined("b", "N*s/m", sd=0.0)
    b = model.refined("b", "N*s/m", sd=0.1)
    with pytest.raises(PvidError, match="equation 1 of the refinement"):
        model.refine([m * x.d(2) + b * x + k * x - F])
    model.refine([m * x.d(2) + b * x.d() + k * x - F], region=[k - m])
    made = refine_functions_of(model.compiled("test"), {})
    assert [(one.name, one.place, one.log) for one in made.parameters] == [
        ("m", 0, True),
        ("k", 1, True),
        ("b", -1, False),
    ]
    model.refined("lost", "1", sd=1.0)
    with pytest.raises(PvidError, match="lost is in no equation of the refinement"):
        refine_functions_of(model.compiled("test"), {})


def test_an_option_adds_its_parameters_and_nothing_else() -> None:
    pendulum = compiled_of("kapitza")
    assert pendulum.options == ("dry_friction", "slant") and pendulum.with_options([]) is pendulum
    plain = functions("kapitza")
    slanted, dry = (functions(f"kapitza {one}") for one in ("slant", "dry_friction"))
    names = [[one.name for one in made.parameters] for made in (plain, slanted, dry)]
    assert names[1] == [*names[0][:5], "slant", *names[0][5:]]
    assert names[2][2:] == [*names[0][:5], "f1", "f2", *names[0][5:]]
    assert [one.sign for one in dry.parameters[:2]] == ["a1_1 - a2_1", "a1_1"]
    assert (slanted.runge_kutta, dry.runge_kutta) == (False, True)
    assert functions("kapitza dry_friction slant").model.refinement.extras != pendulum.refinement.extras


def test_the_second_stage_of_a_mechanism_without_an_input_is_strict_c(tmp_path: Path) -> None:
    """Coasts down: C has no array without elements, and every unsigned number is at least 0."""
    model = Model("coast")
    v = model.sensor("v", "m/s", resolution=1e-3, reach=20)
    m, b = model.known("m", "kg", 80.0), model.unknown("b", "N*s/m", 2.0)
    drag = model.unknown("drag", "kg/m", 0.3)
    model.equation(m * v.d() + b * v + drag * v * abs(v))
    made = refine_functions(model.compiled("coast"))
    assert made.inputs == ()
    (tmp_path / "pvid").mkdir()
    (tmp_path / "pvid" / "refine_shape.h").write_text(files_refine.shape(made, "test"), encoding="utf-8")
    (tmp_path / "refine_model_f32.h").write_text(files_refine.header(made, "test"), encoding="utf-8")
    sources = map(str, (one for one in core_of(FLOAT, refined=True) if of_second_stage(one)))
    options = ("-std=c99", "-O1", "-c", *WARNINGS, f"-I{tmp_path}", *INCLUDES, f"-I{NATIVE}", "-DPVID_MAX_P=3")
    done = subprocess.run(
        [host_compiler("this test"), *options, *sources], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
