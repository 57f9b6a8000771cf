"""The rig file of a mechanism with a compiled model: what of it differs from the model's own description.

    sample_rate = 1000        # Hz
    clock_sd = 5e-5           # relative standard deviation of the clock's rate
    [model]
    name = "dc_motor"         # or the name of a model file, which --model of the call must name as well
    [known]
    g = 9.81                  # constants of the model
    [known_sd]
    g = 0.01                  # standard deviations of constants, in their units; 0 where none is given
    [sensor.phi]
    resolution = 0.0015       # in the unit of the signal; noise in resolutions
    delay = 0.002             # its samples are taken so much later than those of the other signals [s]
    [sensor.V]
    gain_sd = 0.005           # of any signal, an input too: relative standard deviation of its gain
    reach = 24                # largest absolute value: the range of a fixed-point core
    [nominal]
    R = 1.2                   # rough guesses of unknowns or outputs of the model: the start of the estimate
    [identifier]
    forgetting_s = 20         # how the estimate follows a change: see Following
    [refine]
    dry_friction = true       # options of the model's second stage in C
    [excitation]
    burst_s = 2.0             # of a commissioning (pvid.configuration.excitation)
    [excitation.V]
    limit = 12                # largest absolute value of a drive or a signal, in its unit
    [excitation.phi]
    speed = 400               # largest rate of a signal [unit/s]

A key that the model does not have becomes a PvidError that names it and lists those that it has.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.toml_text import MOST_BYTES, TOO_LONG, NotATableError, copied, key_and_value, put, quoted, toml_document
from pvid.base.wording import listed, shown
from pvid.rig.columns import Channel

if TYPE_CHECKING:  # it loads SymPy
    from pvid.model.compiled import CompiledModel, Unknown
    from pvid.model.description import Model as Description
    from pvid.models.registry import Mechanism

_Read = TypeVar("_Read")

_KEYS = (
    "sample_rate",
    "clock_sd",
    "model",
    "known",
    "known_sd",
    "sensor",
    "nominal",
    "identifier",
    "refine",
    "excitation",
)
_OF_AN_INPUT = ("gain_sd", "delay_sd", "offset_sd", "reach")
OF_A_SENSOR = ("resolution", "noise", "gain_sd", "delay_sd", "offset_sd", "neglected", "delay", "reach")
_POSITIVE = ("reach", "sample_rate")
OF_THE_IDENTIFIER = ("forgetting_s", "outlier_gate", "outlier_patience_s", "dead_zone")  # fields of Following


@dataclass(frozen=True)
class MechanismRig:
    """A rig of any mechanism.

    Attributes
    ----------
    model : name of a shipped mechanism, or the path of a model file or the model that this call named
        (pvid.models.registry)
    sample_rate : [Hz]; None: that of the run
    known, known_sd : values of the model's constants, and standard deviations of them
    sensor : by signal: resolution, reach, offset_sd [its unit], noise [resolutions], gain_sd [relative], delay and
        delay_sd [s], neglected (see Signal); of an input gain_sd, delay_sd, offset_sd and reach alone
    nominal : guesses of unknowns, or of outputs, from which those of unknowns follow
    identifier : what differs from Following's defaults
    refine : options of the refinement in C that are chosen or not
    excitation : limits of a commissioning by signal; "": its burst; {}: there is none
    clock_sd : relative standard deviation of the sample rate; None: the model's
    """

    model: Mechanism
    sample_rate: float | None = None
    known: Mapping[str, float] = field(default_factory=dict)
    sensor: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    nominal: Mapping[str, float] = field(default_factory=dict)
    known_sd: Mapping[str, float] = field(default_factory=dict)
    identifier: Mapping[str, float] = field(default_factory=dict)
    refine: Mapping[str, bool] = field(default_factory=dict)
    excitation: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    clock_sd: float | None = None

    @classmethod
    def parse(cls, text: str) -> MechanismRig:
        """From TOML text.

        Raises PvidError naming the key that is no key of such a file, or whose value is no number.
        """
        return cls.of_document(toml_document(text))

    @classmethod
    def of_document(cls, document: Mapping[str, Any], asked: Mechanism | None = None) -> MechanismRig:
        """From the tables of a text; see `parse`. `asked`: the mechanism of this call, in place of the text's."""
        refuse_other_keys(document)
        model = _table(document, "model").get("name") if asked is None else asked
        if model is None or (asked is None and not isinstance(model, str)):
            raise PvidError('the mechanism is missing: [model] name = "dc_motor", or the path of a model file')
        top = _numbers({key: document[key] for key in ("sample_rate", "clock_sd") if key in document}, "")
        sensors = _table(document, "sensor")
        return cls(
            model,
            known=_numbers(_table(document, "known"), "known"),
            sensor={one: _numbers(_table(sensors, one, "sensor."), f"sensor.{one}", OF_A_SENSOR) for one in sensors},
            nominal=_numbers(_table(document, "nominal"), "nominal"),
            known_sd=_numbers(_table(document, "known_sd"), "known_sd"),
            identifier=_numbers(_table(document, "identifier"), "identifier", OF_THE_IDENTIFIER),
            refine=_switches(_table(document, "refine"), "refine"),
            excitation=_excitation(_table(document, "excitation")),
            **top,
        )

    def text(self) -> str:
        """TOML text; `parse` gives the same rig back."""
        lines = [] if self.sample_rate is None else [f"sample_rate = {self.sample_rate!r}  # Hz"]
        lines += [] if self.clock_sd is None else [f"clock_sd = {self.clock_sd!r}"]
        name = self.model if isinstance(self.model, str) else getattr(self.model, "name", self.compiled().name)
        lines += ["", "[model]", f"name = {quoted(name)}"]
        tables: dict[str, Mapping[str, float]] = {"known": self.known, "known_sd": self.known_sd}
        tables |= {f"sensor.{name}": keys for name, keys in self.sensor.items()}
        tables |= {"nominal": self.nominal, "identifier": self.identifier}
        tables |= {f"excitation.{name}".rstrip("."): keys for name, keys in self.excitation.items()}
        for name, keys in tables.items():
            if keys:
                lines += ["", f"[{name}]", *(f"{key} = {value!r}" for key, value in keys.items())]
        if self.refine:
            lines += ["", "[refine]", *(f"{key} = {str(value).lower()}" for key, value in self.refine.items())]
        return "\n".join(lines).lstrip("\n") + "\n"

    def write(self, path: Path) -> None:
        """Writes `text` to a file."""
        try:
            write_whole(path, self.text())
        except OSError as error:
            raise PvidError(f"{path}: cannot be written: {error.strerror}") from error

    def compiled(self) -> CompiledModel:
        """The compiled model of its mechanism, with its values; loads SymPy."""
        from pvid.models.mechanisms import compiled_of

        return self.applied(compiled_of(self.model))

    def applied(self, model: CompiledModel) -> CompiledModel:
        """The model with the values of this rig.

        Raises PvidError naming a constant, signal, unknown or option that the model does not have, or a guess that it
        excludes.
        """
        _refuse_unknown("known", self.known, [one.name for one in model.knowns])
        _refuse_unknown("sensor", self.sensor, [one.name for one in model.signals])
        for signal in model.signals:
            if signal.kind == "input" and set(self.sensor.get(signal.name, {})) - {*_OF_AN_INPUT}:
                raise PvidError(f"sensor.{signal.name}: an input of the model has {listed(_OF_AN_INPUT)} alone")
        _refuse_unknown("nominal", self.nominal, [*model.p_names, *(one.name for one in model.outputs)])
        _refuse_unknown("known_sd", self.known_sd, [one.name for one in model.knowns])
        _refuse_unknown("refine", self.refine, list(model.options))
        knowns = tuple(
            replace(one, value=value, sd=self.known_sd.get(one.name, one.sd * grown))
            for one in model.knowns
            for value in [self.known.get(one.name, one.value)]
            for grown in [abs(value / one.value) if one.value else 1.0]
        )
        signals = []
        for signal in model.signals:
            given: dict[str, Any] = dict(self.sensor.get(signal.name, {}))
            stated = "resolution" in given or not isinstance(self.model, str)  # an author knows his own sensors
            signals.append(replace(signal, given=stated, **given))
        unknowns = self._unknowns(replace(model, knowns=knowns))
        following = replace(model.following, **self.identifier)
        clock_sd = model.clock_sd if self.clock_sd is None else self.clock_sd
        own = replace(
            model, knowns=knowns, signals=tuple(signals), unknowns=unknowns, following=following, clock_sd=clock_sd
        )
        return own.with_options([name for name, chosen in self.refine.items() if chosen])

    def _unknowns(self, model: CompiledModel) -> tuple[Unknown, ...]:
        """Those of a model that has the constants of this rig, with the guesses of this rig."""
        unknowns = []
        for one in model.unknowns:
            follows = one.guess if one.guess_of is None else float(model.with_knowns(one.guess_of))
            guess, grown = self.nominal.get(one.name, follows), follows / one.guess if one.guess_of is not None else 1.0
            if one.positive and not guess > 0:
                raise PvidError(f"nominal.{one.name} must be positive, not {guess:g}")
            sd, low, high = 2 * guess if one.positive else one.sd, grown * one.low, grown * one.high
            unknowns.append(replace(one, guess=guess, sd=sd, low=low, high=high))
        outputs = {name: value for name, value in self.nominal.items() if name not in model.p_names}
        if not outputs:
            return tuple(unknowns)
        from pvid.rig.guesses import unknowns_of  # SciPy's search, a quarter of a second

        fixed = frozenset(self.nominal) & frozenset(model.p_names)
        return unknowns_of(replace(model, unknowns=tuple(unknowns)), outputs, fixed)

    def refuse_lacking(self, model: CompiledModel) -> None:
        """PvidError where a constant that differs from rig to rig has no value in this one."""
        lacking = [one for one in model.knowns if one.required and one.name not in self.known]
        if lacking:
            typed = " ".join(f"--set known.{one.name}={one.value:g}" for one in lacking)
            names = listed(f"{one.name} [{one.unit}]" if one.unit else one.name for one in lacking)
            raise PvidError(f"{names} of the rig is missing: use {typed} with the value of your rig")


def refuse_other_keys(document: Mapping[str, Any], model: CompiledModel | None = None) -> None:
    """PvidError where a key of a text is none, with those of the model that may be meant."""
    for key in document:
        if key in _KEYS:
            continue
        refusal = f"{shown(key)} is not a key of the rig file of a mechanism"
        if model is None:
            raise PvidError(f"{refusal}: {listed(_KEYS)} are")
        outputs = [one.name for one in model.outputs]
        known = {one.name: f"known.{one.name}" for one in model.knowns}
        meant = {name: f"nominal.{name}" for name in (*model.p_names, *outputs)}
        meant |= {one.name: f"sensor.{one.name}.resolution" for one in model.signals if one.kind != "input"}
        if key in model.p_names or key in outputs:
            raise PvidError(
                f"{shown(key)} is no constant of {model.name} but is identified: nominal.{key} is its rough guess"
            )
        asked = ""
        for names in (meant | {one: one for one in _KEYS}, known):  # a constant before others that are as near
            folded = {name.casefold(): text for name, text in names.items()}
            for name in get_close_matches(key.casefold(), folded, 1, 0.5):
                asked = f": is {folded[name]} meant?"
        constants = listed(known.values()) if known else "none"
        guesses = listed(f"nominal.{name}" for name in (*model.p_names, *outputs))
        raise PvidError(
            f"{refusal}{asked}; constants of {model.name}: {constants}; rough guesses: {guesses}; others: "
            f"{listed(one for one in _KEYS if one not in ('known', 'nominal'))}"
        )


def rig_path_of(run_path: Path) -> Path:
    """RUN.toml, beside RUN.csv or RUN.csv.gz."""
    name = run_path.name.removesuffix(".gz")
    return run_path.with_name(Path(name).stem + ".toml")


def parsed_file(path: str | Path, parse: Callable[[str], _Read]) -> _Read:
    """What `parse` makes of a file's text; PvidError names the file, and what `parse` names."""
    try:
        with Path(path).open("rb") as file:
            data = file.read(MOST_BYTES + 1)
    except OSError as error:
        raise PvidError(f"{path}: cannot be read: {error.strerror}") from error
    if len(data) > MOST_BYTES:
        raise PvidError(f"{path}: {TOO_LONG}")
    try:
        text = data.decode("utf-8-sig").replace("\r\n", "\n").replace("\r", "\n")
    except ValueError as error:
        raise PvidError(f"{path}: is not UTF-8 text") from error
    try:
        return parse(text)
    except PvidError as error:
        raise PvidError(f"{path}: {error}") from error


def channels_of(model: CompiledModel | Description) -> tuple[Channel, ...]:
    """The signals of a model as channels of a recording."""
    return tuple(Channel(one.name, one.unit, held=one.kind == "input" and one.hold == "zoh") for one in model.signals)


def with_settings(document: Mapping[str, Any], settings: Iterable[str]) -> dict[str, Any]:
    """The tables of a rig file with `KEY=VALUE` in place of its own: known.g=9.7, sensor.phi.resolution=1e-3.

    Raises PvidError where a setting is none.
    """
    changed = copied(document)
    for setting in settings:
        key, value = key_and_value(setting, "known.g=9.81")
        try:
            put(changed, key, value)
        except NotATableError as error:
            raise PvidError(f"--set {shown(setting)}: {error.table} is a number, not a table") from error
    return changed


def _table(document: Mapping[str, Any], name: str, inside: str = "") -> Mapping[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, Mapping):
        raise PvidError(f"{inside}{name} must be a table, [{inside}{name}], not {shown(str(table))}")
    return table


def _numbers(table: Mapping[str, Any], place: str, keys: Collection[str] | None = None) -> dict[str, float]:
    for key, value in table.items():
        if keys is not None and key not in keys:
            raise PvidError(f"{place}: {shown(key)} is not a key: {listed(keys)} are")
        if isinstance(value, bool) or not isinstance(value, int | float) or not isfinite(value):
            name = f"{place}.{key}" if place else key
            raise PvidError(f"{name} must be a number, not {shown(str(value))}")
        least = key in (*OF_A_SENSOR, "sample_rate") or place in ("known_sd", "identifier")
        if least and key != "delay" and not value >= 0:
            raise PvidError(f"{place}.{key} must not be negative".removeprefix("."))
        if key in _POSITIVE and value == 0:
            raise PvidError(f"{place}.{key} must be positive".removeprefix("."))
    return {key: float(value) for key, value in table.items()}


def _excitation(table: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Its own keys under "", then a table for each signal."""
    own = {key: value for key, value in table.items() if not isinstance(value, Mapping)}
    found = {"": _numbers(own, "excitation")} if own else {}
    for name, keys in table.items():
        if isinstance(keys, Mapping):
            found[name] = _numbers(keys, f"excitation.{name}")
    return found


def _switches(table: Mapping[str, Any], place: str) -> dict[str, bool]:
    for key, value in table.items():
        if not isinstance(value, bool):
            raise PvidError(f"{place}.{key} must be true or false, not {shown(str(value))}")
    return dict(table)


def _refuse_unknown(table: str, given: Iterable[str], names: list[str]) -> None:
    for name in given:
        if name not in names:
            of_model = f"it has {listed(names)}" if names else "it has none"
            raise PvidError(f"{table}.{name}: the model has no {shown(name)}; {of_model}")
