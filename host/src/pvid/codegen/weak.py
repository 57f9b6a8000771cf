"""The weak form of a model as the identifier of weak.h takes it: functions to generate, tables of channels and terms.

    jets -> prepare -> derivatives of the runs, arguments of sgn
    jets, runs, signs -> values -> gains, integrands
    channel = gain I^fold[integrand],   column += factor D^order[channel]

The channels and terms are those of the float64 oracle (pvid.oracle.weak.channels), with the corners of held inputs.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy as sp

from pvid.base.errors import PvidError
from pvid.base.recent import Recent
from pvid.codegen.functions import Function, ModelFunctions, functions_of, identifiers
from pvid.codegen.weak_sizes import refuse_too_many_unknowns, sizes_of_model
from pvid.model.compiled import CompiledModel
from pvid.model.corners import OfInput
from pvid.model.operations import program_of
from pvid.model.signals import Integral, Jet, jets
from pvid.oracle.weak.channels import Channel, Channels
from pvid.oracle.weak.identify import ready
from pvid.settings.weak import NONE, Source, ThetaModel, WeakChannel, WeakJet, WeakKind, WeakModel, WeakSignal, WeakTerm

_ONE = sp.Integer(1)
_OF_ROWS = ("integrands", "channels")
_HIGHEST_FOLD = 2


_SOURCES = {"jump": Source.JUMP, "before": Source.LAST, "after": Source.SAMPLED}


@dataclass(frozen=True)
class WeakFunctions:
    """What is generated for the weak identifier, and its tables.

    Attributes
    ----------
    functions : of the model with corners; theta, Jacobian and pattern are among them
    prepare : jets -> derivatives of the runs, arguments of sgn
    values : jets, runs, signs -> gains, integrands
    samples : names of the entries of a sample, in the order of the model's signals
    signal, jet, channel, term, kind : as in pvid.settings.weak
    jet_names, run_names, sign_names, gain_names, integrand_names : what each place is
    """

    functions: ModelFunctions
    prepare: Function
    values: Function
    samples: tuple[str, ...]
    signal: tuple[WeakSignal, ...]
    signal_names: tuple[str, ...]
    jet: tuple[WeakJet, ...]
    channel: tuple[WeakChannel, ...]
    term: tuple[WeakTerm, ...]
    kind: tuple[WeakKind, ...]
    jet_names: tuple[str, ...]
    run_names: tuple[str, ...]
    sign_names: tuple[str, ...]
    gain_names: tuple[str, ...]
    integrand_names: tuple[str, ...]

    @property
    def name(self) -> str:
        """Of the model, in C."""
        return self.functions.name

    @property
    def with_results(self) -> tuple[Function, ...]:
        """The functions that have results."""
        own = (self.prepare, self.values, *(one for one in self.functions.functions if one.name not in _OF_ROWS))
        return tuple(one for one in own if one.labels)

    @property
    def model(self) -> CompiledModel:
        """With corners."""
        return self.functions.model

    @property
    def turning(self) -> dict[int, int]:
        """Samples that may turn without end, for derivatives of them alone are used -> the channel that they are."""
        found = {}
        inside = (*self.gain_names, *self.integrand_names, *self.sign_names, *self.run_names)
        for place, name in enumerate(self.samples):
            uses = [one for one in inside if re.search(rf"\b{name}\b", one)]
            gains = [self.gain_names.index(one) for one in uses if one in self.gain_names]
            channels = [k for k, one in enumerate(self.channel) if one.gain in gains]
            orders = [one.order for one in self.term if one.channel in channels]
            if uses == [name] and len(channels) == 1 and min(orders, default=0) > 0:
                found[place] = channels[0]
        return found


@Recent
def weak_functions_of(compiled: CompiledModel) -> WeakFunctions:
    """What is generated for the weak identifier; `compiled` is the model without corners.

    Raises PvidError where a channel needs what the identifier has no state for.
    """
    made = ready(compiled)
    model, whole = made.model, made.channels
    plain = _Plain(whole)
    samples = tuple(one.name for one in compiled.signals)
    used = _ordered(model, whole)
    signal_names = tuple(dict.fromkeys(jet.of for jet in used))
    shelf = _Shelf(plain)
    for one in [one for one in whole.channels if one.fold or one.gain != _ONE]:
        shelf.place_of(one)
    for one in [one for one in whole.channels if one.fold]:
        shelf.complete(one)
    places = [shelf.place_of(one) for one in whole.channels]  # the constant comes last
    jet_names = identifiers([str(one) for one in used])
    run_names = identifiers([str(one) for one in plain.runs])
    marks = list(whole.sign_marks.values())
    sign_names = tuple(str(one) for one in whole.signs)
    inputs: list[sp.Symbol] = [*used, *plain.runs, *marks]
    names = identifiers([*jet_names, *run_names, *(f"sign_{k}" for k in range(len(marks)))])
    before = [*plain.runs.values(), *(plain.of_jets(one) for one in whole.signs)]
    after = [*shelf.gains, *shelf.integrands]
    return WeakFunctions(
        functions=functions_of(model),
        prepare=Function("prepare", program_of(used, before, jet_names), tuple(before), tuple(map(str, before))),
        values=Function("values", program_of(inputs, after, names), tuple(after), tuple(map(str, after))),
        samples=samples,
        signal=tuple(_signal(model, made.jumps.get(name), name, samples) for name in signal_names),
        signal_names=signal_names,
        jet=tuple(WeakJet(signal_names.index(jet.of), jet.order) for jet in used),
        channel=tuple(shelf.channels),
        term=_terms(whole, places),
        kind=_kinds(whole),
        jet_names=tuple(str(one) for one in used),
        run_names=tuple(f"integral of {one}" for one in plain.runs.values()),
        sign_names=sign_names,
        gain_names=tuple(str(one.xreplace(plain.back)) for one in shelf.gains),
        integrand_names=tuple(str(one.xreplace(plain.back)) for one in shelf.integrands),
    )


def theta_model(functions: ModelFunctions) -> ThetaModel:
    """theta and the pattern of its Jacobian."""
    return ThetaModel(
        n_theta=len(functions.theta.labels),
        positive=tuple(one.positive for one in functions.model.unknowns),
        c_row=functions.c_row,
        c_column=functions.c_column,
        kind_end=functions.kind_end,
        constraints=len(functions.model.constraints),
        drifts=len(functions.model.drifts),
    )


@Recent
def weak_model_of(compiled: CompiledModel) -> WeakModel:
    """The tables of a compiled model, without corners as given.

    Raises PvidError where the identifier does not have what the model needs.
    """
    refuse_too_many_unknowns(compiled)
    made = weak_functions_of(compiled)
    model = WeakModel(
        name=made.name,
        sample_names=made.samples,
        jet_names=made.jet_names,
        run_names=made.run_names,
        sign_names=made.sign_names,
        gain_names=made.gain_names,
        integrand_names=made.integrand_names,
        signal=made.signal,
        jet=made.jet,
        channel=made.channel,
        term=made.term,
        kind=made.kind,
        model=theta_model(made.functions),
    )
    sizes_of_model(model)  # raises
    return model


def _ordered(model: CompiledModel, whole: Channels) -> list[Jet]:
    """The jets that the channels need, in the model's order of signals."""
    order = [one.name for one in model.signals]
    return sorted(whole.needed, key=lambda jet: (order.index(jet.of), jet.order))


def _signal(model: CompiledModel, made: OfInput | None, name: str, samples: Sequence[str]) -> WeakSignal:
    if made is not None:
        return WeakSignal(samples.index(made.name), _SOURCES[made.kind])
    held = model.signal(name).hold == "zoh"
    return WeakSignal(samples.index(name), Source.HELD if held else Source.SAMPLED)


def _terms(whole: Channels, places: Sequence[int]) -> tuple[WeakTerm, ...]:
    return tuple(
        WeakTerm(places[one.channel], one.order, one.column, np.float32(one.factor))
        for row in whole.rows
        for one in sorted(row.terms, key=lambda one: (one.column, one.order, one.channel))
    )


def _kinds(whole: Channels) -> tuple[WeakKind, ...]:
    found, first = [], 0
    for row in whole.rows:
        found.append(WeakKind(row.thetas, row.nuisances, first, first + len(row.terms)))
        first += len(row.terms)
    return tuple(found)


class _Plain:
    """Puts the definitions of auxiliary signals in their places, and a symbol in that of a run.

    Attributes
    ----------
    runs : symbol -> what it is the integral of, since the start of the run, in jets
    back : sign mark -> sgn(argument), for names
    """

    def __init__(self, whole: Channels) -> None:
        self._name = whole.model.name
        self._signs = whole.sign_marks
        self._opaque = dict(whole.opaque)
        self.back = {mark: one for one, mark in whole.sign_marks.items()}
        self.runs: dict[sp.Symbol, sp.Expr] = {}

    def __call__(self, expression: sp.Expr) -> sp.Expr:
        """In jets of signals, symbols of runs and marks of signs."""
        found = expression
        while any(jet in self._opaque for jet in jets(found)):
            found = found.xreplace(self._opaque)
        integrals = {one: self._run(one) for one in sorted(found.atoms(Integral), key=sp.default_sort_key)}
        return found.xreplace(integrals).xreplace(self._signs)

    def of_jets(self, expression: sp.Expr) -> sp.Expr:
        """The same where runs and signs are not known yet."""
        found = self(expression)
        if found.free_symbols - jets(found):
            raise PvidError(
                f"{self._name}: {expression} has a sign or an integral inside, which the weak identifier cannot nest"
            )
        return found

    def _run(self, integral: sp.Expr) -> sp.Symbol:
        integrand, fold = integral.args
        if fold != 1:
            raise PvidError(f"{self._name}: {integral} since the start of the run: the weak identifier integrates once")
        inside = self.of_jets(integrand)
        for mark, one in self.runs.items():
            if one == inside:
                return mark
        mark = sp.Symbol(f"run_{len(self.runs)}", real=True)
        self.runs[mark] = inside
        return mark


class _Shelf:
    """Gains, integrands and channels as they are found; equal ones share a place."""

    def __init__(self, plain: _Plain) -> None:
        self._plain = plain
        self.gains: list[sp.Expr] = []
        self.integrands: list[sp.Expr] = []
        self.channels: list[WeakChannel] = []

    def place_of(self, channel: Channel) -> int:
        """Of a channel of the oracle; an integral's companions are added by `complete`."""
        if channel.fold > _HIGHEST_FOLD:
            raise PvidError(f"{channel.gain} times a {channel.fold}-fold integral: the weak identifier has two at most")
        gain = self._plain(channel.gain)
        if channel.fold == 0:
            return self._put(WeakChannel(NONE if gain == _ONE else self._in(self.gains, gain)))
        integrand = self._plain(channel.integrand)
        inside = NONE if integrand == _ONE else self._in(self.integrands, integrand)
        return self._put(WeakChannel(self._in(self.gains, gain), inside, channel.fold))

    def complete(self, channel: Channel) -> None:
        """Adds the channels that shift an integral to the start of a window's first half."""
        place = self.place_of(channel)
        one = self.channels[place]
        plain = self._put(WeakChannel(one.gain))
        ramp = NONE
        if one.fold == 2:
            ramp = self._put(WeakChannel(one.gain, NONE, 1))
            self.channels[ramp] = WeakChannel(one.gain, NONE, 1, plain)
        self.channels[place] = WeakChannel(one.gain, one.integrand, one.fold, plain, ramp)

    def _put(self, channel: WeakChannel) -> int:
        for place, one in enumerate(self.channels):
            if (one.gain, one.integrand, one.fold) == (channel.gain, channel.integrand, channel.fold):
                return place
        self.channels.append(channel)
        return len(self.channels) - 1

    @staticmethod
    def _in(shelf: list[sp.Expr], expression: sp.Expr) -> int:
        if expression not in shelf:
            shelf.append(expression)
        return shelf.index(expression)
