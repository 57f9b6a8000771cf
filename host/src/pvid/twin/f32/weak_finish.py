"""The number of stages of a window in weak/weak_finish_f32.c."""

from __future__ import annotations

from pvid.settings.weak import WeakConfig
from pvid.twin.f32.estimator import RelativeEstimator

_ENTRIES_PER_STAGE, _PRODUCTS_PER_STAGE, _SHARES_PER_STAGE = 7, 30, 4
_BOTH_FAMILIES = 16


def _parts(whole: int, each: int) -> int:
    return max(1, -(-whole // each))


class Finish:
    """What processes the windows of an identifier."""

    def __init__(self, config: WeakConfig, estimator: RelativeEstimator) -> None:
        self.design, self.estimator = config.design, estimator
        self.iterations = 1 if estimator.is_rate else config.iterations

    def _entries(self) -> int:
        return _parts(len(self.design.noise), _ENTRIES_PER_STAGE)

    def _before_columns(self) -> int:
        """Stages of a kind before its columns."""
        basis = 2 * self.design.power + _parts((self.design.highest + 1), _SHARES_PER_STAGE)
        noise = 1 + (self._entries() + 1) * len(self.estimator.p) if self._checks_noise else 1
        return self._entries() + 2 + basis + noise

    def _reflections(self, kind: int) -> int:
        families = 1 if self.design.functions <= _BOTH_FAMILIES else 2
        return families * self.design.model.kind[kind].columns

    def _behind_projection(self, kind: int) -> int:
        """Stages of a kind from its residuals to its gate."""
        thetas = self.design.model.kind[kind].thetas
        residual = _parts(self.design.functions, max(1, _PRODUCTS_PER_STAGE // (thetas + 1)))
        return residual + _parts(thetas, self._products) + 1

    @property
    def _projections(self) -> int:
        """Columns that a stage projects."""
        return max(1, _PRODUCTS_PER_STAGE // (2 * self.design.functions))

    @property
    def _products(self) -> int:
        """Products of columns that a stage forms."""
        return max(1, _PRODUCTS_PER_STAGE // self.design.functions)

    def _adding(self, kind: int) -> int:
        """Stages with the products of the columns of a kind."""
        thetas = self.design.model.kind[kind].thetas
        return _parts(thetas * (thetas + 1) // 2, self._products)

    def _most_of_columns(self, kind: int) -> int:
        """Stages of a kind until its columns are formed, at most."""
        terms, columns = len(self.design.model.terms_of(kind)), self.design.model.kind[kind].columns
        return self._before_columns() + terms + columns + self._reflections(kind)

    def _most_of_kind(self, kind: int) -> int:
        """Stages of a kind, at most."""
        own = self.design.model.kind[kind]
        project = own.nuisances * (1 + _parts(own.columns - 1, self._projections)) + 1
        behind = self._behind_projection(kind) + self._entries() + 1 + self._adding(kind) + 1
        return self._most_of_columns(kind) + project + behind

    @property
    def stages_of_columns(self) -> int:
        """Of a window until all its columns are formed, at most."""
        last = self.design.model.kinds - 1
        return sum(self._most_of_kind(kind) for kind in range(last)) + self._most_of_columns(last)

    @property
    def stages(self) -> int:
        """Of a window with all its solves, at most."""
        estimator = self.estimator
        of_kinds = sum(self._most_of_kind(kind) for kind in range(self.design.model.kinds))
        solves = estimator.solve_stages(True) + (self.iterations - 1) * (estimator.solve_stages(False) + 1)
        return of_kinds + 7 + len(estimator.p) + solves + estimator.assess_solved_stages

    @property
    def _checks_noise(self) -> bool:
        """S is compared with the information of the sensors' noise; lanes have one margin."""
        return bool(self.estimator.noise_margin[0] > 0) and bool(self.design.noise)
