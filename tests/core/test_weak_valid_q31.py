"""What init of the fixed-point weak identifier refuses: every shift, count, index and factor of its tables."""

from collections.abc import Callable
from typing import Any

import pytest

from pvid.codegen.weak_library import weak_native_q31
from pvid.configuration.weak_q31 import weak_q31_for_simulated_rig
from pvid.core.weak_native_q31 import WeakNativeQ31
from pvid.models.mechanisms import compiled_of
from pvid.settings.enums import Status


class Tables:
    """A copy of a configuration with its design and model, whose fields may be overwritten."""

    def __init__(self, native: WeakNativeQ31) -> None:
        self.ffi, self.library = native.headers.ffi, native.library
        self.kept: list[Any] = []
        self.config = self._copied(getattr(self.library, f"{native.name}_settings_q31"), 1)
        self.design = self._copied(self.config.design, 1)
        self.model = self._copied(self.design.model, 1)
        self.config.design, self.design.model = self.design, self.model
        counts = {"signal": "signals", "jet": "jets", "channel": "channels", "kind": "kinds"}
        for name, count in counts.items():
            setattr(self.model, name, self._copied(getattr(self.model, name), getattr(self.model, count)))
        terms = self.model.kind[self.model.kinds - 1].end
        self.model.term = self._copied(self.model.term, terms)
        of_design = {
            "full_scale": self.model.samples,
            "down": self.model.signals,
            "filter": self.model.jets,
            "integral": self.model.integrands,
            "format": self.model.channels,
            "factor": terms,
            "noise": self.design.n_noise,
            "error_order": self.model.kinds,
            "error_variance": self.model.kinds,
        }
        for name, count in of_design.items():
            setattr(self.design, name, self._copied(getattr(self.design, name), count))

    def _copied(self, pointer: Any, count: int) -> Any:
        kind = self.ffi.typeof(pointer).item.cname
        copy = self.ffi.new(f"{kind}[]", max(count, 1))
        self.ffi.memmove(copy, pointer, count * self.ffi.sizeof(kind))
        self.kept.append(copy)
        return self.ffi.cast(f"{kind} *", copy)

    def status(self) -> Status:
        """Of init."""
        self.kept.append(self.ffi.new("pvid_weak_q31 *"))
        return Status(self.library.pvid_weak_init_layout_q31(self.kept[-1], self.config, self.library.pvid_layout()))


@pytest.fixture(scope="module")
def native() -> WeakNativeQ31:
    weak = weak_q31_for_simulated_rig(compiled_of("kapitza"))
    return weak_native_q31(weak.made, weak.parameters, weak.config)


def _set(owner: Callable[[Tables], Any], field: str | int, value: Any) -> Callable[[Tables], None]:
    def change(tables: Tables) -> None:
        if isinstance(field, int):
            owner(tables)[field] = value
        else:
            setattr(owner(tables), field, value)

    return change


def _of(field: str, place: int = 0) -> Callable[[Tables], Any]:
    return lambda tables: getattr(tables.design, field)[place]


def _in_model(field: str, place: int = 0) -> Callable[[Tables], Any]:
    return lambda tables: getattr(tables.model, field)[place]


HOSTILE: list[tuple[Callable[[Tables], None], Status]] = [
    *((_set(_of("format"), one, value), Status.BAD_SHIFT) for one, value in (("value", 31), ("lift", 31), ("own", 40))),
    *((_set(_of("format"), one, 63), Status.BAD_SHIFT) for one in ("plain", "ramp")),
    *(
        (_set(_of("integral"), one, value), Status.BAD_SHIFT)
        for one, value in (("down", 31), ("twice", 0), ("twice", 31))
    ),
    *((_set(lambda t: t.design, "sum_shift", value), Status.BAD_SHIFT) for value in (0, 1, 17)),
    (_set(_of("filter"), "down", 63), Status.BAD_DESIGN),
    (_set(_of("filter"), "half", 60000), Status.BAD_DESIGN),
    (_set(lambda t: t.design.down, 0, 40), Status.BAD_FULL_SCALE),
    *((_set(lambda t: t.design.full_scale, 0, value), Status.BAD_FULL_SCALE) for value in (0, -1, 2**24)),
    *((_set(_of("factor"), one, value), Status.BAD_MODEL) for one, value in (("m", 2**30 + 1), ("e", 9000))),
    *((_set(_of("noise"), one, 9), Status.BAD_DESIGN) for one in ("kind", "power", "a", "b")),
    (_set(lambda t: t.design.noise[0].factor, "e", -9000), Status.BAD_DESIGN),
    (_set(lambda t: t.design.error_order, 0, 8), Status.BAD_DESIGN),
    (_set(_of("error_variance"), "m", -1), Status.BAD_DESIGN),
    *((_set(lambda t: t.design, "hop", value), Status.BAD_WINDOW) for value in (4, 50, 8192)),
    (_set(lambda t: t.design, "decimation", 0), Status.BAD_DECIMATION),
    *((_set(lambda t: t.design, "power", value), Status.BAD_FUNCTIONS) for value in (0, 5, 40)),
    (_set(lambda t: t.design, "functions", 3), Status.BAD_FUNCTIONS),
    (_set(lambda t: t.design, "power", 4), Status.BAD_MODEL),  # below the order of a term
    *((_set(_in_model("term"), one, 60), Status.BAD_MODEL) for one in ("channel", "column", "order")),
    *((_set(_in_model("jet"), one, 60), Status.BAD_MODEL) for one in ("signal", "order")),
    *((_set(_in_model("signal"), one, 7), Status.BAD_MODEL) for one in ("sample", "source")),
    *((_set(_in_model("channel"), one, 40), Status.BAD_MODEL) for one in ("gain", "fold")),
    *((_set(_in_model("kind"), one, 200), Status.BAD_MODEL) for one in ("thetas", "nuisances", "first")),
    (_set(lambda t: t.model, "samples", 0), Status.BAD_MODEL),
    (_set(lambda t: t.model, "integrands", 30), Status.BAD_MODEL),
]


def test_the_tables_of_the_design_tool_are_accepted(native: WeakNativeQ31) -> None:
    assert Tables(native).status() == Status.OK


@pytest.mark.parametrize("place", range(len(HOSTILE)))
def test_a_table_out_of_range_is_refused(place: int, native: WeakNativeQ31) -> None:
    change, expected = HOSTILE[place]
    tables = Tables(native)
    change(tables)
    assert tables.status() == expected
