"""The rig file: properties of a rig and settings of the identifier, in TOML.

    l1 = 0.30                 # m; the only key without a default
    sample_rate = 1000        # Hz
    [sensor]
    phi_lsb = 3.835e-4        # rad
    [nominal]
    l2 = 0.1                  # m
    [identifier]
    law = "stationary"
    [model]
    name = "kapitza"

Every key is a field of the dataclasses below, which hold its unit, range and default. A wrong key or value
becomes a PvidError that names it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import MISSING, Field, dataclass, field, fields
from operator import attrgetter
from pathlib import Path
from typing import Any, Literal, get_args

from pvid.base.atomic_write import write_whole
from pvid.base.errors import PvidError
from pvid.base.toml_text import toml_document
from pvid.models.model import Mechanism
from pvid.models.registry import DEFAULT, MODELS
from pvid.rig.mechanism_file import parsed_file
from pvid.settings.enums import Form
from pvid.settings.forms import CORES, FORMS, AnyCore, CoreTraits, FormTraits

Law = Literal["stationary", "pseudovelocity"]
Core = AnyCore
Differentiator = Literal["savitzky-golay", "finite-difference"]

# The strong form is least wrong with degree 12 and 20 bits on a window this long.
_STRONG_WINDOW_S = 0.241


# What is no zero but smaller is a slip, and what is divided by it overflows.
_LEAST = 1e-12


class Unset(float):
    """Default of a key that is missing in the rig file."""


def _number(default: Any, unit: str, low: float, high: float) -> Any:
    """A field that holds a number from low to high; an int where the default is one."""
    metadata = {"unit": unit, "low": low, "high": high}
    return field(default=default, metadata=metadata)


def _choice(default: str, choices: Any) -> Any:
    return field(default=default, metadata={"choices": get_args(choices)})


@dataclass(frozen=True)
class Sensor:
    """Resolutions, for the scaling of fixed-point cores and for predicted errors; 0: exact.

    Attributes
    ----------
    phi_lsb : resolution of the encoder; default: that of the recorded run, without a run 14 bits per turn
    y_lsb : resolution of the pivot sensor
    phi_zero : approximate reading of the encoder at rest; needed if it is beyond 1 rad, for example half a turn
    y_delay : delay of the pivot's samples after those of phi; the host shifts y by it, a board does not
    y_gain_sd : relative standard deviation of the gain of y; part of the standard errors, because no run shows it
    phi_range : fixed point: largest angle from rest that is accepted; 0: 0.5 rad, or more if the run needs it
    y_range : fixed point: largest height of the pivot about the middle of its travel; 0: a tenth of l1, or more if the
        run needs it
    acceleration_range : fixed point, strong form: largest acceleration of the pivot; 0: twice that of the run, without
        a run four times the nominal g
    """

    phi_lsb: float = _number(Unset(2.0 * math.pi / 2**14), "rad", 0.0, 1.0)
    y_lsb: float = _number(5e-6, "m", 0.0, 1.0)
    phi_zero: float = _number(0.0, "rad", -1e3, 1e3)
    y_delay: float = _number(0.0, "s", -1.0, 1.0)
    y_gain_sd: float = _number(0.003, "relative", 0.0, 1.0)
    phi_range: float = _number(0.0, "rad", 0.0, 10.0)
    y_range: float = _number(0.0, "m", 0.0, 1e6)
    acceleration_range: float = _number(0.0, "m/s^2", 0.0, 1e9)

    def __post_init__(self) -> None:
        _check_fields(self, "[sensor] ")


@dataclass(frozen=True)
class Nominal:
    """A rough guess of the unknowns: start of the estimate, centre of its bounds, whitening.

    Attributes
    ----------
    g : the part of gravity that lies in the plane of motion
    l2 : distance from the joint to the centre of mass of body 2
    rho2 : radius of gyration of body 2
    """

    l2: float = field(metadata={"unit": "m", "low": 1e-6, "high": 1e6})
    rho2: float = field(metadata={"unit": "m", "low": 1e-6, "high": 1e6})
    g: float = _number(9.8, "m/s^2", 1e-3, 1e3)

    def __post_init__(self) -> None:
        _check_fields(self, "[nominal] ")


@dataclass(frozen=True)
class Identifier:
    """How to identify.

    Attributes
    ----------
    form : "weak" (integrals, for real encoders) or "strong" (the derivatives of the paper, for 20 bits and more)
    law : "stationary" (with feedback, converges) or "pseudovelocity" (the paper's equation (5), literally)
    core : "f32" (float32), "q31" (fixed point) or "f64" (the float64 oracle, on the host only)
    window_s : strong form: window of the differentiator; 0: 0.241 s
    differentiator : filters of the strong form
    degree : strong form: degree of the Savitzky-Golay polynomial
    stride : strong form: points between the taps of the differentiator; a point is a sample, or a block of them
    block : strong form, Savitzky-Golay: odd number of samples whose mean is a point, with a row for each block:
        memory and time of a window of window_s fall by this factor, with 2 % (phi) to 14 % (its fourth derivative)
        more noise
    forgetting_s : time constant of forgetting; 0: no forgetting; the cores f32 and q31
    feedback_hz : strong form, stationary law: rate at which F decays; 0: a whole Gauss-Newton step at every solve
    divider : strong form: ticks per solve
    kappa_min : strong form: hold the estimate while less than this share of the information on w is its own
    outlier_gate : reject rows or windows whose residuals exceed this multiple of the usual; 0: no gate; default: 4
        (weak form), 6 (strong form), and no gate with the law pseudovelocity
    outlier_patience_s : the gate accepts a changed mechanism after this time; 0: never; default: half of
        forgetting_s, or 100 windows without forgetting (weak form); 6 times forgetting_s (strong form)
    dead_zone : keep p while it is within this many standard errors of the solution of all data; 0: no dead zone
    """

    form: Form = _choice("weak", Form)
    law: Law = _choice("stationary", Law)
    core: Core = _choice("f32", Core)
    window_s: float = _number(0.0, "s", 0.0, 1e6)
    differentiator: Differentiator = _choice("savitzky-golay", Differentiator)
    degree: int = _number(12, "", 4, 12)
    stride: int = _number(1, "points", 1, 65535)
    block: int = _number(1, "samples", 1, 8191)
    forgetting_s: float = _number(0.0, "s", 0.0, 1e12)
    feedback_hz: float = _number(10.0, "1/s", 0.0, 1e12)
    divider: int = _number(1, "", 1, 65535)
    kappa_min: float = _number(1e-5, "", 0.0, 0.999)
    outlier_gate: float | None = _number(None, "", 0.0, 1e3)
    outlier_patience_s: float | None = _number(None, "s", 0.0, 1e12)
    dead_zone: float = _number(0.0, "", 0.0, 100.0)

    def __post_init__(self) -> None:
        _check_fields(self, "[identifier] ")

    @property
    def form_traits(self) -> FormTraits:
        """What depends on the form."""
        return FORMS[self.form]

    @property
    def core_traits(self) -> CoreTraits:
        """What depends on the core."""
        return CORES[self.core]

    @property
    def strong_window_s(self) -> float:
        """Length of the differentiator's window [s]."""
        return self.window_s if self.window_s > 0.0 else _STRONG_WINDOW_S

    @property
    def gate(self) -> float:
        """Limit of the gate [multiples of the usual residual]: outlier_gate, or 4 (weak form) and 6 (strong form) if
        the key is missing; 0 with the paper's law (5)."""
        if self.outlier_gate is not None:
            return self.outlier_gate
        return self.form_traits.gate if self.law == "stationary" else 0.0

    @property
    def patience_s(self) -> float | None:
        """Time until the gate accepts a change [s], 0: never; None: weak form without forgetting, of some windows."""
        if self.outlier_patience_s is not None:
            return self.outlier_patience_s
        if self.form_traits.publishes and not self.forgetting_s:
            return None
        return min(self.form_traits.patience * self.forgetting_s, 1e12) if self.gate > 0.0 else 0.0


@dataclass(frozen=True)
class Refine:
    """What the second stage in C estimates besides viscous friction and the skew of the sensors; in float64 the
    refinement tries both where the residuals ask for it.

    Attributes
    ----------
    dry_friction : second stage in C: estimate the sharp friction of pivot and joint too, f1 and f2; 7 times the
        instructions, and twice the RAM
    slant : second stage in C: estimate the slant of the pivot's slide against the vertical too, along which y is read
    """

    dry_friction: bool = False
    slant: bool = False

    def __post_init__(self) -> None:
        _check_fields(self, "[refine] ")


@dataclass(frozen=True)
class ModelTable:
    """The mechanism of the rig.

    Attributes
    ----------
    name : the mechanism, one of the folders of pvid.models
    """

    name: str = field(default=DEFAULT, metadata={"choices": tuple(MODELS)})

    def __post_init__(self) -> None:
        _check_fields(self, "[model] ")


@dataclass(frozen=True)
class RigFile:
    """A rig and the way to identify it.

    Attributes
    ----------
    l1 : length of rod 1
    nominal, sensor, identifier, refine, model : the tables of the file
    sample_rate : rate of the samples; default: that of the run
    l1_sd : relative standard deviation of l1; part of the standard errors, because no run shows it
    """

    l1: float = field(metadata={"unit": "m", "low": 1e-6, "high": 1e6})
    nominal: Nominal
    sensor: Sensor = field(default_factory=Sensor)
    identifier: Identifier = field(default_factory=Identifier)
    sample_rate: float | None = _number(None, "Hz", 1e-3, 1e6)
    l1_sd: float = _number(0.001, "relative", 0.0, 1.0)
    model: ModelTable = field(default_factory=ModelTable)
    refine: Refine = field(default_factory=Refine)

    def __post_init__(self) -> None:
        _check_fields(self, "")

    @property
    def mechanism(self) -> Mechanism:
        """The model with the rig's known constants."""
        model = MODELS[self.model.name]
        return Mechanism(model, {one.name: getattr(self, one.name) for one in model.constants})

    @property
    def n_core(self) -> int:
        """Number of the mapped parameters and, where it is estimated, of the offset."""
        model = self.mechanism.model
        return len(model.published) if self.identifier.form_traits.estimates_zero else model.n_mapped

    @property
    def scale_sd(self) -> dict[str, float]:
        """Standard deviations of the model's scales by their names, relative."""
        return {one.name: attrgetter(one.sd_key)(self) for one in self.mechanism.model.scales}

    @classmethod
    def standard(cls) -> RigFile:
        """The standard rig of theory.md 6, as written by a user with exact l1 and sensors only: a
        simulation has no error of l1 or of the gain of y."""
        sensor = Sensor(y_gain_sd=0.0)
        return cls(l1=0.3, nominal=Nominal(l2=0.1, rho2=0.1), sensor=sensor, sample_rate=1000.0, l1_sd=0.0)

    @classmethod
    def parse(cls, text: str) -> RigFile:
        """From TOML text; PvidError names the key that is unknown, missing, of wrong type or out of range."""
        return cls.of_document(toml_document(text))

    @classmethod
    def of_document(cls, document: Mapping[str, Any]) -> RigFile:
        """From the tables of a file; raises as `parse`."""
        top = _known(cls, document, "")
        model = ModelTable(**_table(top.pop("model", {}), "model"))
        for one in MODELS[model.name].constants:
            if one.name not in top:
                raise PvidError(f"{one.name} is missing: the {one.meaning} [{one.unit}]")
        tables = {name: _table(top.pop(name, {}), name) for name in _TABLES}
        top = _without_integers(cls, top)
        _check_value(_field(cls, "l1"), top["l1"], "")
        third = top["l1"] / 3.0
        guess = {"l2": third, "rho2": third, **tables["nominal"]}
        return cls(
            nominal=Nominal(**guess),
            sensor=Sensor(**tables["sensor"]),
            identifier=Identifier(**tables["identifier"]),
            refine=Refine(**tables["refine"]),
            model=model,
            **top,
        )

    def text(self) -> str:
        """TOML text with every key and its unit; `parse` gives the same rig back."""
        lines = _lines(self)
        for name in _TABLES:
            lines += ["", f"[{name}]", *_lines(getattr(self, name))]
        return "\n".join(lines) + "\n"

    def write(self, path: str | Path) -> None:
        """Writes `text` to a file."""
        try:
            write_whole(Path(path), self.text())
        except OSError as error:
            raise PvidError(f"{path}: cannot be written: {error.strerror}") from error


def load(path: str | Path) -> RigFile:
    """Reads a rig file; PvidError names the file and the key."""
    return parsed_file(path, RigFile.parse)


_TABLES: dict[str, type] = {
    "sensor": Sensor,
    "nominal": Nominal,
    "identifier": Identifier,
    "refine": Refine,
    "model": ModelTable,
}


def _field(owner: type, name: str) -> Field[Any]:
    return next(f for f in fields(owner) if f.name == name)


_CHOSEN = "the weak form chooses it from the run; leave it out"
_REFINED = "`identify` fits the full equations, with both viscous frictions, after the weak form; leave it out"
_GONE = {
    **dict.fromkeys(("test_functions", "decimation", "smoothing_s", "pass_hz", "disturbance", "survey"), _CHOSEN),
    **dict.fromkeys(("full_angle", "damping"), _REFINED),
    "zero": "the weak form estimates the zero of the encoder always; leave it out",
}


def _known(owner: type, given: Mapping[str, Any], place: str) -> dict[str, Any]:
    """The keys of a table, refused when the dataclass has no such field."""
    names = [f.name for f in fields(owner)]
    for key in given:
        if (gone := _GONE.get(key)) and key not in names:
            raise PvidError(f"{place}{key} is no key any more: {gone}")
        if key not in names:
            raise PvidError(f"{place}{key!a} is not a key of a rig file; known keys: {', '.join(names)}")
    return dict(given)


def _table(given: Any, name: str) -> dict[str, Any]:
    if not isinstance(given, dict):
        raise PvidError(f"{name} must be a table, [{name}], not {_shown(given)}")
    return _without_integers(_TABLES[name], _known(_TABLES[name], given, f"[{name}] "))


def _without_integers(owner: type, given: dict[str, Any]) -> dict[str, Any]:
    """1000 stands for 1000.0 where a float is wanted."""

    def converted(name: str, value: Any) -> Any:
        key = _field(owner, name)
        wants_float = "low" in key.metadata and not _wants_integer(key)
        return float(value) if type(value) is int and wants_float and abs(value) < 2**53 else value

    return {name: converted(name, value) for name, value in given.items()}


def _wants_integer(key: Field[Any]) -> bool:
    return key.default is not MISSING and type(key.default) is int


def _check_fields(owner: Any, place: str) -> None:
    for key in fields(owner):
        if key.metadata or key.type == "bool":
            _check_value(key, getattr(owner, key.name), place)


def _check_value(key: Field[Any], value: Any, place: str) -> None:
    """Refuses a value of the wrong type or out of the range in the field's metadata."""
    name = f"{place}{key.name}"
    if "choices" in key.metadata:
        if value not in key.metadata["choices"]:
            known = " or ".join(f'"{choice}"' for choice in key.metadata["choices"])
            raise PvidError(f"{name} must be {known}, not {_shown(value)}")
        return
    if key.type == "bool":
        if type(value) is not bool:
            raise PvidError(f"{name} must be true or false, not {_shown(value)}")
        return
    if value is None and key.default is None:
        return
    wanted = int if _wants_integer(key) else float
    if type(value) is not wanted and not (wanted is float and type(value) in (int, Unset)):
        kind = "a whole number" if wanted is int else "a number"
        raise PvidError(f"{name} must be {kind}, not {_shown(value)}")
    low, high, unit = key.metadata["low"], key.metadata["high"], key.metadata["unit"]
    if not low <= value <= high or (low == 0 and 0 < value < _LEAST):
        wide = f"0 or from {_LEAST:g}" if low <= value <= high else f"from {low:g}"
        wide = f"{wide} to {high:g} {unit}".rstrip()
        raise PvidError(f"{name} must be {wide}, not {_shown(value)}")


def _shown(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    try:
        text = ascii(value)
    except (ValueError, RecursionError):  # thousands of digits, or of tables in one another
        return "that"
    return text if len(text) <= 40 else text[:40] + "..."


# Fields without a default, and the property with the value that follows from the others.
_DERIVED = {"outlier_gate": "gate", "outlier_patience_s": "patience_s"}


def _lines(owner: Any) -> list[str]:
    """`key = value  # unit` for each field that holds a value; in a comment what follows where it holds none."""
    lines = []
    for key in fields(owner):
        value = getattr(owner, key.name)
        if key.name in _TABLES:
            continue
        if value is None:
            if key.name in _DERIVED:
                follows = getattr(owner, _DERIVED[key.name])
                lines.append(f"# {key.name}" if follows is None else f"# {key.name} = {follows!r}")
            continue
        shown = (
            f'"{value}"' if isinstance(value, str) else str(value).lower() if isinstance(value, bool) else repr(value)
        )
        unit = key.metadata.get("unit", "")
        lines.append(f"{key.name} = {shown}" + (f"  # {unit}" if unit else ""))
    return lines
