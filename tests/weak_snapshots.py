"""What a snapshot of the weak form must contain and refuse, from the headers: pointers of the state, fields of the
configuration with all tables that it points to."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from pvid.core.headers import Scalar
from pvid.settings.enums import SnapshotStatus

HEADER = 36
CHECKSUM = 4
_SLACK = 4  # entries behind each table, so that a count may be one too large

Length = Callable[[Any, Any], int]


def pointer_places(ffi: Any, ctype: Any, start: int = 0) -> Iterator[int]:
    """Offsets of the pointers in a type of C."""
    match ctype.kind:
        case "pointer":
            yield start
        case "struct" | "union":
            for _, field in ctype.fields:
                yield from pointer_places(ffi, field.type, start + field.offset)
        case "array":
            item = int(ffi.sizeof(ctype.item))
            for place in range(ctype.length):
                yield from pointer_places(ffi, ctype.item, start + place * item)


# Lengths of the tables, from the struct that points to them and the model.
_BOTH: dict[str, Length] = {
    "drive_min": lambda config, model: model.samples,
    "trust.shared": lambda trust, model: model.model.n_p * (model.model.n_p + 1) // 2,
    "design": lambda config, model: 1,
    "design.model": lambda design, model: 1,
    "design.noise": lambda design, model: design.n_noise,
    "design.error_order": lambda design, model: model.kinds,
    "design.error_variance": lambda design, model: model.kinds,
    "design.sign_width": lambda design, model: model.signs,
    "design.model.signal": lambda model, _: model.signals,
    "design.model.jet": lambda model, _: model.jets,
    "design.model.channel": lambda model, _: model.channels,
    "design.model.term": lambda model, _: model.kind[model.kinds - 1].end,
    "design.model.kind": lambda model, _: model.kinds,
    "design.model.model": lambda model, _: 1,
    "design.model.model.kind_end": lambda p, _: p.n_kinds if p.n_kinds > 1 else 0,
    "design.model.model.c_row": lambda p, _: p.n_c,
    "design.model.model.c_column": lambda p, _: p.n_c,
}
_LENGTHS: dict[str, dict[str, Length]] = {
    "f32": {
        **_BOTH,
        "range": lambda config, model: model.samples,
        "design.circle": lambda design, model: 5 * design.hop // 2,
        "design.compensator": lambda design, model: model.jets,
        "design.sign_doubt": lambda design, model: model.signs,
        "design.compensator.weights": lambda filter_, model: filter_.half,
    },
    "q31": {
        **_BOTH,
        "design.circle": lambda design, model: 7 * design.hop // 2 + 3 * (design.functions // 2 + design.power // 2),
        "offset": lambda config, model: model.samples,
        "design.full_scale": lambda design, model: model.samples,
        "design.down": lambda design, model: model.signals,
        "design.filter": lambda design, model: model.jets,
        "design.filter.weights": lambda filter_, model: filter_.half + 1,
        "design.run": lambda design, model: model.runs,
        "design.integral": lambda design, model: model.integrands,
        "design.format": lambda design, model: model.channels,
        "design.factor": lambda design, model: model.kind[model.kinds - 1].end,
    },
}
# Set by init; functions, which are hashed by their results.
_NOT_READ = {
    "f32": {"estimator.model", "estimator.update_rate_hz", "estimator.row_weight", "estimator.correlation"},
    "q31": {"estimator.model", "estimator.row_weight", "design.model.model.scaled"},
}
_OF_P = {f"estimator.{name}" for name in ("start", "start_sd", "lower", "upper", "p_bits")}
_OF_THETA = {"estimator.n_bits"}


class Copied:
    """A configuration with all that it points to, in memory of its own.

    Attributes
    ----------
    pointer : pvid_weak_config_<core> *
    numbers : every number of it, of its design, its model and their tables that a snapshot depends on
    """

    def __init__(self, ffi: Any, core: str, config: Any) -> None:
        self._ffi, self._lengths, self._not_read = ffi, _LENGTHS[core], _NOT_READ[core]
        self.pointer = ffi.new(f"pvid_weak_config_{core} *", config)
        self._owners: list[Any] = []
        self.numbers: list[Scalar] = []
        self._model = config.design.model
        self._walk(self.pointer[0], "")

    def _walk(self, struct: Any, path: str) -> None:
        for name, field in self._ffi.typeof(struct).fields:
            whole, kind = f"{path}.{name}" if path else name, field.type.kind
            if whole in self._not_read or kind == "function":
                continue
            if kind == "struct":
                self._walk(getattr(struct, name), whole)
            elif kind == "array":
                array = getattr(struct, name)
                places = range(self._used(whole, field.type.length))
                self.numbers += [Scalar(f"{whole}[{k}]", field.type.item, array, k) for k in places]
            elif kind == "pointer":
                self._table(struct, name, whole, field.type.item)
            else:
                self.numbers.append(Scalar(whole, field.type, struct, name))

    def _used(self, whole: str, length: int) -> int:
        """Entries of an array that this model uses."""
        if whole in _OF_P:
            return int(self._model.model.n_p)
        return int(self._model.model.n_theta) if whole in _OF_THETA else length

    def _table(self, struct: Any, name: str, whole: str, item: Any) -> None:
        given = getattr(struct, name)
        missing = given == self._ffi.NULL
        if missing and not whole.startswith("design."):
            return  # a limit that is not set; a table of a design is missing where it has no entries
        length = 0 if missing else int(self._lengths[whole](struct, self._model))
        table = self._ffi.new(f"{item.cname.removeprefix('const ')}[]", length + _SLACK)
        self._owners.append(table)
        for k in range(length):
            table[k] = given[k]
        setattr(struct, name, table)
        for k in range(length):
            if item.kind == "struct":
                self._walk(table[k], whole)
            else:
                self.numbers.append(Scalar(f"{whole}[{k}]", item, table, k))


class Identifier:
    """An identifier of the weak identifier of either core, by its functions in C.

    Parameters
    ----------
    config : pvid_weak_config_<core> *
    """

    def __init__(self, ffi: Any, library: Any, core: str, config: Any) -> None:
        self.ffi, self._library, self._core, self.config = ffi, library, core, config
        self.type = f"pvid_weak_{core}"
        self.state = ffi.new(f"{self.type} *")
        self._image = ffi.new("uint8_t[]", ffi.sizeof(self.type) + HEADER + CHECKSUM)
        self._owner: Copied | None = None
        self.initialise()

    def _call(self, name: str, *arguments: Any) -> Any:
        return getattr(self._library, f"pvid_{name}_{self._core}")(self.state, *arguments)

    def initialise(self) -> None:
        """Of memory that contains anything."""
        self.memory[:] = b"\xa5" * len(self.memory)
        assert self._call("weak_init_layout", self.config, self._library.pvid_layout()) == 0

    @property
    def memory(self) -> Any:
        """The object, byte by byte."""
        return self.ffi.buffer(self.state)

    def run(self, samples: Any) -> list[int]:
        """Steps through samples [ticks, samples] of the core's type; returns the reasons."""
        whole = np.ascontiguousarray(samples)
        kind = "const float *" if self._core == "f32" else "const int32_t *"
        return [self._call("weak_step", self.ffi.cast(kind, tick.ctypes.data)) for tick in whole]

    def save(self) -> bytes:
        """A snapshot."""
        n = self._call("snapshot_save_weak", self.config, 1, self._image, len(self._image))
        return bytes(self.ffi.buffer(self._image, n))

    def restore(self, image: bytes) -> SnapshotStatus:
        """Restores it."""
        return SnapshotStatus(self._call("snapshot_restore_weak", self.config, image, len(image)))

    def copied(self) -> Copied:
        """Gives it a configuration that may be changed."""
        copied = self._owner = Copied(self.ffi, self._core, self.config[0])
        self.config = copied.pointer
        self.initialise()
        return copied


def changed(number: Scalar) -> Any:
    """Another value."""
    value = number.value
    if isinstance(value, bool):
        return not value
    if isinstance(value, float):
        return value + 1.0 if abs(value) < 1000.0 else 2.0 * value
    return value + 1 if value not in (127, 255, 2**15 - 1, 2**16 - 1, 2**31 - 1, 2**32 - 1) else value - 1


def refusal(name: str) -> SnapshotStatus:
    """The answer to another value of a field of the configuration."""
    if name.startswith("design.model."):
        return SnapshotStatus.OTHER_MODEL
    return SnapshotStatus.OTHER_DESIGN if name.startswith("design.") else SnapshotStatus.OTHER_CONFIG


def assert_continues_from_every_tick(one: Identifier, other: Identifier, samples: Any) -> None:
    """Asserts that after each tick `other` continues as `one` from a snapshot, byte for byte."""
    for tick in range(len(samples)):
        image = one.save()
        other.initialise()
        assert other.restore(image) is SnapshotStatus.RESTORED
        assert other.save() == image
        assert one.run(samples[tick : tick + 1]) == other.run(samples[tick : tick + 1])
        assert other.save() == one.save(), tick


def assert_every_change_is_refused(one: Identifier) -> None:
    """Asserts that a snapshot is refused for another value of any number of the configuration, and changes nothing."""
    copied = one.copied()
    image, before, seen = one.save(), bytes(one.memory), set()
    for number in copied.numbers:
        kept = number.value
        number.set(changed(number))
        assert one.restore(image) is refusal(number.name), number.name
        number.set(kept)
        seen.add(refusal(number.name))
    assert len(seen) == 3 and bytes(one.memory) == before
    damaged = image[:100] + bytes([image[100] ^ 1]) + image[101:]
    assert one.restore(damaged) is SnapshotStatus.DAMAGED
    assert one.restore(image[:-1]) is SnapshotStatus.CUT_SHORT
    assert bytes(one.memory) == before and one.restore(image) is SnapshotStatus.RESTORED


def assert_every_function_is_hashed(one: Identifier, signature: str, result: Any) -> None:
    """Asserts that a model with the same tables and a function of other results is another model."""
    copied = one.copied()
    image, model = one.save(), copied.pointer.design.model
    nothing = one.ffi.callback(signature, lambda given, out: result)
    for name in ("values", "prepare"):
        kept = getattr(model, name)
        setattr(model, name, nothing)
        assert one.restore(image) is SnapshotStatus.OTHER_MODEL, name
        setattr(model, name, kept)
    assert one.restore(image) is SnapshotStatus.RESTORED


def assert_every_byte_is_kept(one: Identifier, other: Identifier) -> list[int]:
    """Asserts that every byte is saved and restored but those of pointers; returns those that restore has set."""
    size = one.ffi.sizeof("void *")
    found = sorted(set(pointer_places(one.ffi, one.ffi.typeof(one.type))))  # parts of a union share theirs
    places = [place + k for place in found for k in range(size)]
    one.memory[:] = b"\xa5" * len(one.memory)
    one.state.design = one.config.design
    image, kept = one.save(), bytes(other.memory)
    saved = image[HEADER:-CHECKSUM]
    assert [place for place, byte in enumerate(saved) if byte != 0xA5] == places
    assert {saved[place] for place in places} == {0, 1}
    assert other.restore(image) is SnapshotStatus.RESTORED
    now = bytes(other.memory)
    assert all(byte == 0xA5 for place, byte in enumerate(now) if place not in places)
    return [place for place in places if now[place] != kept[place]]
