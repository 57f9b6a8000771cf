"""What a person writes: signals, constants, unknowns and equations."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import Any, Literal

import sympy as sp

from pvid.model.compiled import CompiledModel, Extra, Known, Output, Refinement, Row, Signal, Unknown
from pvid.model.compiler import rows_of
from pvid.model.eliminate import Equation
from pvid.model.normal_form import rational
from pvid.model.readable import latex, readable
from pvid.model.refusal import ModelError, place_of_caller
from pvid.model.signals import MAX_ORDER, Integral, Jet, jets, total_derivative
from pvid.model.typed import typed_expression
from pvid.model.units import NUMBER, Dimension, dimension_of, dimension_of_unit

_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
# What ends a comment, a string or a line of a generated file, or is expanded in one (C, Python, YAML, Kconfig, CMake).
_NOT_IN_A_TITLE = {"\\": "/", '"': "'", "*/": "* /", "/*": "/ *", "$": "S", "{": "(", "}": ")", "??": "?", "`": "'"}
_GAIN_SD = 0.01  # of what is driven, unless given: no residual shows a torque constant that is 1 % off
_GAIN_SD_OF_SENSOR = 0.005  # of what measures no angle: shunts, load cells, pulleys behind an encoder
_TAKEN = {"t": "the time"}


class Model:
    """A mechanism; `compiled` makes rows of it.

    Each of sensor, input, unmeasured, define, known and unknown returns a SymPy symbol for the equations.
    """

    def __init__(self, title: str) -> None:
        if not isinstance(title, str):
            raise ModelError(f"the title {title!r} is no text: Model('motor on a shaft')", place_of_caller())
        self.title = _plain(title)
        self.signals: list[Signal] = []
        self.unknowns: list[Unknown] = []
        self.knowns: list[Known] = []
        self.outputs: list[Output] = []
        self.meanings: dict[str, str] = {}
        self.hidden: list[Jet] = []
        self.defined: dict[Jet, sp.Expr] = {}
        self.equations: list[Equation] = []
        self.constraints: list[sp.Expr] = []
        self.drifts: list[dict[sp.Symbol, sp.Expr]] = []
        self.drift_s = 0.0
        self._dimensions: dict[str, Dimension] = {}
        self._coordinates: list[Jet] = []
        self._extras: list[Extra] = []
        self._shapes: dict[sp.Symbol, sp.Expr] = {}
        self._refinement = Refinement()

    # ---- in a notebook

    def _repr_latex_(self) -> str:
        return f"$\\displaystyle {latex(one.expression for one in self.equations)}$" if self.equations else ""

    @property
    def _kinds(self) -> dict[str, Sequence[Signal | Unknown | Known | Output]]:
        return {"signal": self.signals, "unknown": self.unknowns, "known": self.knowns, "output": self.outputs}

    def __repr__(self) -> str:
        kinds = {kind: ", ".join(f"{one.name} [{one.unit or 1}]" for one in ones) for kind, ones in self._kinds.items()}
        told = (f"    {kind}: {ones}" for kind, ones in kinds.items() if ones)
        equations = (f"    {readable(one.expression)} = 0" for one in self.equations)
        return "\n".join([f"Model({self.title!r})", *equations, *told])

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{escape(one.name)}</td><td>{escape(one.unit)}</td><td>{kind}</td></tr>"
            for kind, ones in self._kinds.items()
            for one in ones
        )
        return f"<p><strong>{escape(self.title)}</strong></p><p>{self._repr_latex_()}</p><table>{rows}</table>"

    # ---- quantities

    def sensor(
        self,
        name: str,
        unit: str,
        resolution: float = 0.0,
        noise: float | None = None,
        reach: float = 1.0,
        driven: bool = False,
        gain_sd: float | None = None,
        neglected: float = 0.0,
    ) -> Jet:
        """A measured signal.

        Parameters
        ----------
        resolution : of the sensor [unit]
        noise : standard deviation of its white noise, in resolutions (0.5); in its unit where there is no resolution
        reach : largest absolute value [unit]
        driven : it measures what the drive imposes, such as the current of a load
        gain_sd : relative standard deviation of its gain, which most runs do not show; 0.01 if it is driven, else
            0.005, and 0 of an angle, as an encoder has a whole number of counts a turn
        neglected : of equations for small values: relative error over the square of the signal, from its mean
            [1/unit^2]; part of the standard errors
        """
        if resolution < 0 or not math.isfinite(resolution):
            raise self._refused(f"{name}: resolution must not be negative")
        if not 0 <= neglected < math.inf:
            raise self._refused(f"{name}: neglected must be a number of at least 0, not {neglected}")
        if noise is None and resolution == 0:
            raise self._refused(f"{name}: give its resolution or its noise [{unit or 1}]")
        level = 0.5 if noise is None else noise
        jet = self._signal(name, unit, reach)
        gain = self._gain(name, unit, gain_sd, driven)
        self.signals.append(
            Signal(
                jet,
                unit,
                "sensor",
                float(resolution),
                float(level),
                float(reach),
                driven=driven,
                gain_sd=gain,
                neglected=float(neglected),
            )
        )
        return jet

    def input(
        self,
        name: str,
        unit: str,
        hold: Literal["zoh", "sampled"],
        reach: float = 1.0,
        gain_sd: float | None = None,
        smooth: bool = False,
    ) -> Jet:
        """A signal that is known exactly but for its gain (relative standard deviation gain_sd, 0.01).

        hold "zoh": the value set at t_k holds until t_(k+1); "sampled": it is a value at t_k. smooth: the drive never
        makes the held value jump; the refinement in C then takes steps of several samples, which cost less.
        """
        if hold not in ("zoh", "sampled"):
            raise self._refused(f'{name}: hold is "{hold}", it must be "zoh" or "sampled"')
        jet = self._signal(name, unit, reach)
        gain = self._gain(name, unit, gain_sd, driven=True)
        self.signals.append(Signal(jet, unit, "input", 0.0, 0.0, float(reach), hold, True, gain, smooth=smooth))
        return jet

    def _gain(self, name: str, unit: str, gain_sd: float | None, driven: bool) -> float:
        if gain_sd is None:
            return _GAIN_SD if driven else 0.0 if unit == "rad" else _GAIN_SD_OF_SENSOR
        if not 0 <= gain_sd < 1:
            raise self._refused(f"{name}: gain_sd is a relative standard deviation, from 0 to below 1")
        return float(gain_sd)

    def unmeasured(self, name: str, unit: str) -> Jet:
        """A coordinate that no sensor measures; the compiler eliminates it."""
        jet = self._signal(name, unit, 1.0)
        self.hidden.append(jet)
        return jet

    def define(self, name: str, unit: str, expression: sp.Expr) -> Jet:
        """A signal that is computed of others and treated like a measured one: a second derivative, or
        Integral(i, 1), the integral of i since the start of the run."""
        jet = self._signal(name, unit, 1.0)
        self.defined[jet] = rational(expression)
        self._agree(jet - self.defined[jet], f"the definition of {name}")
        return jet

    def known(self, name: str, unit: str, value: float, sd: float = 0.0, required: bool = False) -> sp.Symbol:
        """A constant with a value and the standard deviation of it, which a rig file may change.

        required : it differs from rig to rig, as a length does: the value here is an example, which no recording is
            identified with
        """
        symbol = self._symbol(name, unit)
        if not math.isfinite(value):
            raise self._refused(f"{name}: its value {value} is no number")
        if not 0 <= sd < math.inf:
            raise self._refused(f"{name}: its standard deviation must be a number of at least 0, not {sd}")
        self.knowns.append(Known(symbol, unit, float(value), float(sd), required))
        return symbol

    def unknown(
        self,
        name: str,
        unit: str,
        guess: float | sp.Expr,
        positive: bool = True,
        low: float | None = None,
        high: float | None = None,
        sd: float | None = None,
    ) -> sp.Symbol:
        """A parameter to identify.

        Parameters
        ----------
        guess : rough value [unit], a number or what it follows from in known constants, as in 9.8 / l1
        positive : it cannot be 0 or below
        low, high : range of the plausible [unit], which the search does not leave where given; else a hundredth and a
            hundred times the guess, or 10 sd around it, with a warning beyond
        sd : how far off the guess can be [unit]; 2 |guess|
        """
        guess_of = guess if isinstance(guess, sp.Expr) and guess.free_symbols else None
        if guess_of is not None:
            guess = guess_of.subs({one.symbol: one.value for one in self.knowns})
            if guess.free_symbols:
                raise self._refused(f"{name}: its guess {guess_of} must follow from known constants")
        if not math.isfinite(guess) or positive and guess <= 0:
            raise self._refused(
                f"{name}: the guess {guess} is not positive; give positive=False if it may have any sign"
            )
        if sd is None and guess == 0:
            raise self._refused(f"{name}: with a guess of 0, give sd, how far off it can be [{unit or 1}]")
        guess = float(guess)
        spread = 2 * abs(guess) if sd is None else sd
        if not spread > 0:
            raise self._refused(f"{name}: sd must be positive")
        least = (guess / 100 if positive else guess - 10 * spread) if low is None else low
        most = (guess * 100 if positive else guess + 10 * spread) if high is None else high
        if not least <= guess <= most:
            raise self._refused(f"{name}: the guess {guess} is outside {least} to {most}")
        symbol = self._symbol(name, unit)
        bounds = (-math.inf if low is None else float(low), math.inf if high is None else float(high))
        self.unknowns.append(
            Unknown(symbol, unit, guess, positive, float(least), float(most), float(spread), bounds, guess_of)
        )
        return symbol

    def output(self, name: str, unit: str, expression: sp.Expr) -> None:
        """A physical parameter that follows from the unknowns."""
        self._is_name(name)
        value = rational(expression)
        self._declared(value)
        if jets(value):
            raise self._refused(f"the output {name} contains a signal; it must follow from unknowns and constants")
        found, wanted = dimension_of(value, self._dimensions), self._unit(unit)
        if found is not None and found != wanted:
            raise self._refused(f"the output {name} has the unit {found}, not {unit or 1}")
        self.outputs.append(Output(name, unit, value))

    def words(self, **meanings: str) -> None:
        """What parameters are, in a few words for a report: words(R="resistance of the winding")."""
        known = {one.name for some in (self.unknowns, self.outputs, self.knowns, self._extras) for one in some}
        for name, meaning in meanings.items():
            if name not in known:
                raise self._refused(f"words: {name} is no parameter that is declared above")
            if not isinstance(meaning, str):
                raise self._refused(f"words: {name} is a few words, not {meaning}")
            self.meanings[name] = _plain(meaning)

    # ---- equations

    def equation(self, expression: sp.Expr, name: str = "") -> None:
        """expression = 0; a SymPy Eq is one as well, and a matrix is an equation for each entry."""
        if isinstance(expression, sp.MatrixBase):
            for one in expression:
                self.equation(one)
            return
        equal = isinstance(expression, sp.Equality)
        whole = rational(expression.lhs - expression.rhs if equal else expression)
        title = name or f"equation {len(self.equations) + 1}"
        if whole == 0 or not jets(whole):
            raise self._refused(f"{title} contains no signal")
        self._agree(whole, title)
        self.equations.append(Equation(title, whole, place_of_caller()))

    def constraint(self, expression: sp.Expr) -> None:
        """expression = 0 between unknowns and known constants, which every estimate meets; a SymPy Eq is one as well.

        Nobody has to solve it for an unknown. An inequality has its margin as a further unknown: with
        `margin = model.unknown("margin", "m", 0.1, positive=False, low=0)` the constraint l1 - l2 - margin is l2 <= l1.
        """
        equal = isinstance(expression, sp.Equality)
        whole = sp.sympify(expression.lhs - expression.rhs if equal else expression)
        title = f"constraint {len(self.constraints) + 1}"
        self._declared(whole)
        if jets(whole):
            raise self._refused(f"{title} contains a signal; it is between unknowns, an equation is between signals")
        if whole.free_symbols.isdisjoint(one.symbol for one in self.unknowns):
            raise self._refused(f"{title} contains no unknown")
        self._agree(whole, title)
        self.constraints.append(whole)

    def drift(self, rates: Mapping[sp.Symbol, sp.Expr], memory_s: float) -> None:
        """A direction in which alone unknowns change in time, as R and k with the heat of a winding.

        Parameters
        ----------
        rates : unknown -> its change by one unit of what drifts, in unknowns and known constants. An unknown in no
            equation may be among them, as the temperature's rise: it begins at its guess, within sd. With it copper is
            linear: {R: alpha*R/(1 + alpha*rise), k: -beta*k/(1 - beta*rise), rise: 1}. {R: alpha*R, k: -beta*k} is
            exponential in temperature, and holds for a few kelvin
        memory_s : time constant of what the rows tell along it [s], as short as the noise allows; one for all drifts
        """
        title = f"drift {len(self.drifts) + 1}"
        own = {one.symbol: one for one in self.unknowns}
        values = {symbol: sp.sympify(rate) for symbol, rate in rates.items()}
        units = set()
        for symbol, rate in values.items():
            if symbol not in own:
                raise self._refused(f"{title}: {symbol} is no unknown")
            self._declared(rate)
            if jets(rate):
                raise self._refused(f"{title}: the rate of {symbol} contains a signal")
            found = dimension_of(rate, self._dimensions) or NUMBER
            units.add(str(found * self._unit(own[symbol].unit).power(sp.Integer(-1))) if rate != 0 else "")
        if len(units - {""}) != 1:
            raise self._refused(f"{title}: its rates, over the units of their unknowns, must be alike, and not all 0")
        if not 0 < memory_s < math.inf or self.drifts and memory_s != self.drift_s:
            raise self._refused(f"{title}: memory_s must be a positive time, the same for all drifts")
        self.drifts.append(values)
        self.drift_s = float(memory_s)

    def add(self, text: str, guess: float = 0.0, sd: float = 1.0) -> None:
        """Adds a term with one new unknown, or changes a signal by it.

        Raises ModelError naming what is wrong with it.

        Parameters
        ----------
        text : "drop*sgn(i)": a term of the only equation; "equation 1: drop*sgn(i)": of the equation with this name;
            "V: V + drop*sgn(V)": what the signal V is in place of what was recorded. The unknown is linear in it.
            "equation 1: a*x; equation 2: -a*x": several with it.
        guess, sd : of the unknown [its unit, which follows from the equation where it can]
        """
        *others, text = text.split(";")
        for other in others:
            self.add(other, guess, sd)
        where, _, expression = text.rpartition(":")
        parsed = typed_expression(expression, self._names())
        if parsed == 0:
            raise ModelError(f"{text}: the term is 0")
        new = sorted((one for one in parsed.free_symbols if str(one) not in self._names_of_symbols()), key=str)
        if len(new) > 1:
            raise ModelError(f"{text}: {' and '.join(map(str, new))} are new; a term has one new unknown")
        if new and sp.expand(parsed).diff(new[0]).has(new[0]):
            raise ModelError(f"{text}: the unknown {new[0]} must be a factor, for example {new[0]}*sgn(...)")
        where = where.strip()
        jet = next((one for one in self._jets() if one.of == where), None)
        places = [k for k, one in enumerate(self.equations) if jet is not None or not where or one.name == where]
        if jet is None and len(places) != 1:
            names = ", ".join(one.name for one in self.equations)
            raise ModelError(f'{text}: write "EQUATION: TERM", with one of {names}')
        if new:
            of = sp.expand(parsed).diff(new[0])
            whole = self.equations[places[0]].expression if jet is None else jet
            self._add_unknown(str(new[0]), self._unit_between(whole, of), guess, sd)
        for k in places:
            own = self.equations[k]
            changed = own.expression + parsed if jet is None else _changed(own.expression, jet, parsed)
            self.equations[k] = replace(own, expression=rational(changed))

    def _add_unknown(self, name: str, unit: str, guess: float, sd: float) -> None:
        symbol = self._symbol(name, unit)
        self.unknowns.append(Unknown(symbol, unit, guess, False, guess - 10 * sd, guess + 10 * sd, sd))

    def _unit_between(self, whole: sp.Expr, factor: sp.Expr) -> str:
        """Of a factor's coefficient in a sum; "" where numbers stand for quantities with a unit."""
        try:
            one, other = (dimension_of(each, self._dimensions) or NUMBER for each in (whole, factor))
        except ModelError:
            return ""
        return (one * other.power(sp.Integer(-1))).unit

    def _names(self) -> dict[str, sp.Symbol]:
        """What a typed expression may name."""
        symbols = [*(one.symbol for one in self.unknowns), *(one.symbol for one in self.knowns)]
        return {one.of: one for one in self._jets()} | {str(one): one for one in symbols}

    def _names_of_symbols(self) -> set[str]:
        orders = range(MAX_ORDER + 1)
        return {str(one.d(k)) for one in self._jets() for k in orders} | set(self._names())

    def lagrange(self, lagrangian: sp.Expr, coordinates: Sequence[Jet], forces: Sequence[sp.Expr]) -> None:
        """d/dt dL/dq' - dL/dq = force, for each coordinate."""
        if len(coordinates) != len(forces):
            raise self._refused(f"lagrange: {len(coordinates)} coordinates but {len(forces)} generalised forces")
        whole = rational(lagrangian)
        self._agree(whole, "the Lagrangian")
        for q, force in zip(coordinates, forces, strict=True):
            momentum = sp.diff(whole, q.d())
            self.equation(total_derivative(momentum) - sp.diff(whole, q) - sp.sympify(force), f"equation of {q}")

    def mechanics(self, method: Any, signals: Mapping[Any, sp.Expr]) -> None:
        """The equations of a LagrangesMethod, KanesMethod or System of sympy.physics.mechanics.

        Parameters
        ----------
        signals : dynamicsymbol or constant -> the signal, unknown or known constant of this model
        """
        from pvid.model.mechanics import equations_of  # a fifth of a second, for models in SymPy's own words alone

        try:
            found = equations_of(method, signals)
        except ModelError as error:
            raise error.at(place_of_caller()) from None
        for one in found:
            self.equation(one)

    # ---- refinement

    def coordinate(self, name: str, unit: str) -> Jet:
        """A coordinate of the refinement's own equations."""
        jet = self._signal(name, unit, 1.0)
        self._coordinates.append(jet)
        return jet

    def refined(self, name: str, unit: str, sd: float, optional: str | None = None) -> sp.Symbol:
        """An unknown of the refinement that the rows do not have: it starts at 0, within about sd [unit].

        optional : key of the rig file's table [refine] without which it is 0; in float64 the residuals choose it
        """
        if not 0 < sd < math.inf:
            raise self._refused(f"{name}: sd must be positive")
        if optional is not None:
            self._is_name(optional)
        symbol = self._symbol(name, unit)
        self._extras.append(Extra(symbol, unit, float(sd), optional or ""))
        return symbol

    def shape(self, name: str, unit: str, expression: sp.Expr) -> sp.Symbol:
        """A positive function of unknowns that the refinement's equations contain in place of these."""
        value = rational(expression)
        self._declared(value)
        symbol = self._symbol(name, unit)
        self._shapes[symbol] = value
        self._agree(symbol - value, f"the shape {name}")
        return symbol

    def refine(
        self,
        equations: Sequence[sp.Expr] = (),
        outputs: Mapping[Jet, sp.Expr] | None = None,
        region: Sequence[sp.Expr] = (),
    ) -> None:
        """What the refinement has of its own.

        Parameters
        ----------
        equations : = 0, in place of those of the rows: for example without the approximation of small angles
        outputs : sensor -> what it measures, where that is no coordinate
        region : expressions in the unknowns that are positive wherever the mechanism is possible
        """
        whole = tuple(rational(one) for one in equations)
        for number, one in enumerate(whole):
            self._agree(one, f"equation {number + 1} of the refinement")
        found = {jet.of: rational(value) for jet, value in (outputs or {}).items()}
        for jet, value in (outputs or {}).items():
            self._agree(jet - rational(value), f"the refinement's output {jet}")
        limits = tuple(rational(one) for one in region)
        for one in limits:
            self._declared(one)
        self._refinement = Refinement(whole, found, region=limits)

    # ---- result

    def compiled(self, name: str = "") -> CompiledModel:
        """Rows, theta and the rest. Raises ModelError where it cannot be done, with the cause."""
        return self._compiled(name, "")

    def compiled_variants(self, name: str = "") -> dict[str, CompiledModel]:
        """Alternatives of integration by parts: "" is the usual one, another key is the signal whose derivative is
        moved to the test function at the price of a derivative of another signal."""
        usual = self._compiled(name, "")
        out = {"": usual}
        for signal in self.signals:
            other = self._compiled(name, signal.name)
            if other.rows != usual.rows:
                out[signal.name] = other
        return out

    def _compiled(self, name: str, by_parts: str) -> CompiledModel:
        if not self.equations:
            raise ModelError(f"{self.title}: the model has no equation")
        if not self.unknowns:
            raise ModelError(f"{self.title}: the model has no unknown")
        integrals = {jet: value for jet, value in self.defined.items() if value.has(Integral)}
        rates = {jet.of: total_derivative(value) for jet, value in integrals.items()}
        hidden = [jet.of for jet in self.hidden]
        rows = rows_of(self.equations, hidden, self.unknowns, rates, by_parts)
        used = {symbol for row in rows for theta in row.theta for symbol in theta.free_symbols}
        used |= {symbol for one in self.constraints for symbol in one.free_symbols}
        anchored = {one for drift in self.drifts for one in drift if one not in used}
        for drift in self.drifts:  # a coefficient of nothing, which has what is known of the start, where others drift
            alone = tuple(one for one in drift if one in anchored)
            empty = Row("", alone, tuple({} for _ in alone), {})
            rows = [
                row if {one for theta in row.theta for one in theta.free_symbols}.isdisjoint(drift)
                else row.with_empty(empty)
                for row in rows
            ]  # fmt: skip
        for one in self.unknowns:
            if one.symbol not in used and one.symbol not in anchored:
                raise ModelError(
                    f"no row contains the unknown {one.name}, so that it cannot be identified: declare it as known"
                )
        unknowns = [self._ranged(one) if one.symbol in anchored else one for one in self.unknowns]
        plain = {jet: value for jet, value in self.defined.items() if jet not in integrals}
        anchors = {one.symbol: one.sd for one in self.unknowns if one.symbol in anchored}
        simulated = [_inserted(one.expression, plain) for one in self.equations]
        simulated += [jet.d() - rates[jet.of] for jet in integrals]
        return CompiledModel(
            name or re.sub(r"\W+", "_", self.title.lower()).strip("_"),
            self.title,
            tuple(self.signals),
            tuple(unknowns),
            tuple(self.knowns),
            tuple(self.outputs),
            tuple(rows),
            dict(self.defined),
            tuple(simulated),
            (*self.hidden, *integrals),
            replace(self._refinement, extras=tuple(self._extras), shapes=dict(self._shapes)),
            constraints=tuple(self.constraints),
            drifts=tuple(tuple(one.get(p.symbol, sp.Integer(0)) for p in self.unknowns) for one in self.drifts),
            drift_s=self.drift_s,
            anchors=anchors,
            meanings=dict(self.meanings),
        )

    @staticmethod
    def _ranged(one: Unknown) -> Unknown:
        """With the half of its range as the size of a large step."""
        low, high = one.bounds
        if one.positive or not math.isfinite(high - low):
            raise ModelError(
                f"{one.name} drifts and is in no equation: give positive=False and its range, low and high"
            )
        return replace(one, sd=(high - low) / 2)

    # ---- checks

    def _refused(self, cause: str) -> ModelError:
        return ModelError(cause, place_of_caller())

    def _unit(self, unit: str) -> Dimension:
        try:
            return dimension_of_unit(unit)
        except ModelError as error:
            raise error.at(place_of_caller()) from None

    def _is_name(self, name: str) -> None:
        if not isinstance(name, str) or not _NAME.fullmatch(name):
            raise self._refused(f"{name!r} is no name: letters, digits and _ after a letter")

    def _new(self, name: str, unit: str) -> None:
        self._is_name(name)
        if name in _TAKEN:
            raise self._refused(f"{name} is {_TAKEN[name]}: choose another name")
        signals = [jet.of for jet in self._jets()]
        clash = {f"{one}_{k}" for one in signals for k in range(1, MAX_ORDER + 1)}
        ahead = {f"{name}_{k}" for k in range(1, MAX_ORDER + 1)}
        if name in self._dimensions or name in clash or ahead & set(self._dimensions):
            raise self._refused(f"{name} is declared twice, or is the name of a derivative of another signal")
        self._dimensions[name] = self._unit(unit)

    def _jets(self) -> list[Jet]:
        return [*(one.jet for one in self.signals), *self.hidden, *self.defined, *self._coordinates]

    def _signal(self, name: str, unit: str, reach: float) -> Jet:
        self._new(name, unit)
        if not 0 < reach < math.inf:
            raise self._refused(f"{name}: reach must be positive")
        return Jet(name)

    def _symbol(self, name: str, unit: str) -> sp.Symbol:
        self._new(name, unit)
        return sp.Symbol(name, real=True)

    def _declared(self, expression: sp.Expr) -> None:
        own = {jet.of for jet in self._jets()}
        symbols = {one.symbol for one in self.unknowns} | {one.symbol for one in self.knowns} | set(self._shapes)
        symbols |= {one.symbol for one in self._extras}
        for one in sorted(expression.free_symbols, key=str):
            if one in symbols or isinstance(one, Jet) and one.of in own:
                continue
            raise self._refused(
                f"{one} is not declared: model.unknown, model.known, model.sensor, model.input or model.unmeasured does"
            )

    def _agree(self, expression: sp.Expr, title: str) -> None:
        self._declared(expression)
        try:
            dimension_of(expression, self._dimensions)
        except ModelError as error:
            raise self._refused(f"{title}: {error.cause}") from None


def _changed(expression: sp.Expr, jet: Jet, instead: sp.Expr) -> sp.Expr:
    """With another expression in place of a signal and its derivatives."""
    own = [one for one in jets(expression) if one.of == jet.of]
    return expression.xreplace({one: total_derivative(instead, one.order) for one in own})


def _plain(title: str) -> str:
    """One line that may stand in a comment, a string or a docstring of any generated file."""
    line = " ".join("".join(one if one.isprintable() else " " for one in title).split())
    for mark, instead in _NOT_IN_A_TITLE.items():
        while mark in line:
            line = line.replace(mark, instead)
    return line


def _inserted(expression: sp.Expr, defined: dict[Jet, sp.Expr]) -> sp.Expr:
    """Definitions in place of the signals that they define."""
    values: dict[Any, Any] = {}
    for jet, value in defined.items():
        for one in jets(expression):
            if one.of == jet.of:
                values[one] = total_derivative(value, one.order)
    return expression.xreplace(values) if values else expression
