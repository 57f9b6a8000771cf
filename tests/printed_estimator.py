"""The estimator printed from its C, with the interface of block_models: of either arithmetic, on any model."""

from collections.abc import Iterable, Mapping
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt
from block_models import BlockModel, BlockModelQ31
from struct_fields import numbers_of

from pvid.core.native import Native
from pvid.core.sources import FOLDERS, sources_of
from pvid.settings.bounds import SIZES
from pvid.settings.enums import Core
from pvid.settings.parts import EstimatorConfig
from pvid.settings.q31 import EstimatorConfigQ31
from pvid.twin.printer.program import printed_module
from pvid.twin.printer.values import filled, number

_VERBS = ("init_layout", "add_kind", "add_to_b", "update", "iterate", "assess")


def printed_core(
    core: Core,
    sizes: Mapping[str, int] | None = None,
    texts: Mapping[str, str] | None = None,
    roots: Iterable[str] = (),
) -> ModuleType:
    """The printed estimator with `roots` of generated texts; sizes: macro -> value, by default those of the library."""
    rooms = ("solve", "number", "judge")
    sources = [path for path in sources_of(core) if path.parent.name in rooms and path.stem != "text"]
    given = SIZES if sizes is None else [f"-D{name}={value}" for name, value in sizes.items()]
    macros = dict(one.removeprefix("-D").split("=") for one in given)
    own = [*(f"pvid_estimator_{verb}_{core}" for verb in _VERBS), "pvid_layout", *roots]
    return printed_module(sources, FOLDERS, macros, own, texts)


def block_model(module: ModuleType, model: BlockModel | BlockModelQ31) -> Any:
    """pvid_model_f32 or pvid_model_q31 of a block model."""
    fixed = isinstance(model, BlockModelQ31)
    real = model.real if isinstance(model, BlockModelQ31) else model

    def called(function: Any) -> Any:
        kind, like = (np.int64, 0) if fixed else (np.float32, np.float32(0))

        def call(p: Any, out: Any) -> None:
            values = [number(one, like) for one in function(np.array(p[: real.n_p], kind))]
            out[: len(values)] = values

        return call

    made = getattr(module, "pvid_model_q31" if fixed else "pvid_model_f32")()
    made.n_theta, made.n_p, made.n_c = real.n_theta, real.n_p, len(real.non_zeros)
    made.positive = 2**real.n_p - 1
    made.c_column, made.c_row = map(list, zip(*real.non_zeros, strict=True))
    if len(real.kind_end) > 1:
        made.n_kinds, made.kind_end = len(real.kind_end), list(real.kind_end)
    made.theta, made.jacobian = called(model.theta), called(model.jacobian)
    if isinstance(model, BlockModelQ31):

        def formats(p_bits: Any, theta_bits: Any, c_bits: Any) -> None:
            theta, c = model.formats(p_bits[: real.n_p])
            theta_bits[: len(theta)], c_bits[: len(c)] = theta, c

        made.formats = formats
    else:
        made.n_moments = sum((k.stop - k.start) * (k.stop - k.start + 1) // 2 for k in real.kinds)
    return made


class PrintedEstimator:
    """pvid_estimator_<core> as printed.

    Parameters
    ----------
    native : whose layout estimates have
    module : printed
    model : of the module
    rate : of the groups [Hz], in float32
    """

    def __init__(
        self,
        native: Native,
        module: ModuleType,
        model: Any,
        config: EstimatorConfig | EstimatorConfigQ31,
        rate: float | None = None,
    ) -> None:
        self._core = core = "f32" if isinstance(config, EstimatorConfig) else "q31"
        self._module, self._native, self.n_p = module, native, int(model.n_p)
        given = filled(module, f"pvid_estimator_config_{core}", config)
        given.model = model
        if rate is not None:
            given.update_rate_hz = np.float32(rate)
        self.state = getattr(module, f"pvid_estimator_{core}")()
        assert self._called("init_layout", given, module.pvid_layout()) == 0

    def _called(self, verb: str, *given: Any) -> int:
        with np.errstate(all="ignore"):
            found = getattr(self._module, f"pvid_estimator_{verb}_{self._core}")(self.state, *given)
        return 0 if found is None else int(found)

    def _numbers(self, values: Iterable[Any]) -> list[Any]:
        like = np.float32(0) if self._core == "f32" else 0
        return [number(one, like) for one in values]

    def add(self, kind: int, n: npt.NDArray[Any], y: float) -> int:
        """Adds a row of a kind; returns the reason."""
        return self._called("add_kind", kind, self._numbers(n), *self._numbers([y]))

    def add_to_b(self, g: npt.NDArray[Any], e: npt.NDArray[Any] | None = None) -> int:
        """Adds g [n_theta], in fixed point g 2^e, to b; returns the reason."""
        if e is None:
            return self._called("add_to_b", self._numbers(g))
        scaled = self._module.pvid_scaled_q31
        return self._called("add_to_b", [scaled(int(a), int(b)) for a, b in zip(g, e, strict=True)])

    def update(self) -> int:
        """Ends a group; returns the reason."""
        return self._called("update")

    def iterate(self) -> int:
        """A further step; returns the reason."""
        return self._called("iterate")

    def assess(self) -> npt.NDArray[np.void]:
        """pvid_estimate_<core>, shape ()."""
        kind = f"pvid_estimate_{self._core}"
        own, out = getattr(self._module, kind)(), np.zeros((), self._native.headers.dtype(kind))
        self._called("assess", own)
        for name in numbers_of(out):
            out[name] = np.reshape(getattr(own, name), out[name].shape)
        return out

    @property
    def p(self) -> npt.NDArray[Any]:
        """[n_p]"""
        return np.array(self.state.p[: self.n_p], np.float32 if self._core == "f32" else np.int64)

    @property
    def sums(self) -> npt.NDArray[np.int64]:
        """In fixed point [n_sums]."""
        return np.array(self.state.information.sums[: self.state.information.n_sums], np.int64)

    @property
    def levels(self) -> npt.NDArray[np.float32]:
        """In float32 both levels of the sums [2, n_sums]."""
        information, model = self.state.information, self.state.model
        n = model.n_moments + model.n_theta + 2
        return np.array([information.high[:n], information.low[:n]], np.float32)

    @property
    def counters(self) -> dict[str, int]:
        """By name."""
        counters = self.state.counters
        return {name: int(getattr(counters, name)) for name in type(counters).__slots__}
