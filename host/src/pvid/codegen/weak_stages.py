"""Stages of a window of the weak form, as weak_finish_f32.c and weak_finish_q31.c count them, and whether the sums of a
window may take the place of the older half's."""

from __future__ import annotations

from pvid.settings.enums import Law
from pvid.settings.weak import WeakConfig, WeakKind
from pvid.settings.weak_q31 import WeakDesignQ31

_BLOCK = 8  # steps that float32 adds to the sums together
_TWO_TICKS = 4  # least decimation whose jets and channels have a tick each
_BLOCK_Q31 = 4

# Parts of a stage in float32: entries of the noise table, harmonics, products of columns, rows of M dtheta, columns.
_ENTRIES, _SHARES, _PRODUCTS, _ROWS, _COLUMNS = 7, 4, 30, 3, 2
_BOTH_FAMILIES = 16  # most functions with which a stage reflects the real and the imaginary parts of a column
# Parts of a stage in fixed point.
_ENTRIES_Q31, _HARMONICS_Q31, _ROOTS_Q31, _UNITS_Q31 = 4, 2, 4, 4
_SHARES_Q31, _RESIDUALS_Q31, _FORMATS_Q31, _END_PARTS_Q31 = 1, 4, 2, 2


def _parts(whole: int, each: int) -> int:
    return max(1, -(-whole // each))


def _of_columns(config: WeakConfig, kind: WeakKind) -> int:
    """Until the columns of a kind are formed."""
    design, entries = config.design, _parts(len(config.design.noise), _ENTRIES)
    checked = config.estimator.noise_margin > 0 and bool(design.noise)
    noise = 1 + (entries + 1) * design.model.model.n_p if checked else 1
    basis = 2 * design.power + _parts(design.highest + 1, _SHARES)
    families = 1 if design.functions <= _BOTH_FAMILIES else 2
    return entries + 2 + basis + noise + (1 + families) * kind.columns + kind.end - kind.first


def _of_kind(config: WeakConfig, kind: WeakKind) -> int:
    functions, thetas = config.design.functions, kind.thetas
    products = max(1, _PRODUCTS // functions)
    projected = _parts(kind.columns - 1, max(1, _PRODUCTS // (2 * functions)))
    rows = _parts(functions, max(1, _PRODUCTS // (thetas + 1)))
    moments = _parts(thetas, products) + _parts(thetas * (thetas + 1) // 2, products)
    entries = _parts(len(config.design.noise), _ENTRIES)
    return _of_columns(config, kind) + kind.nuisances * (1 + projected) + 1 + rows + moments + entries + 3


def column_stages(config: WeakConfig) -> int:
    """Until all columns of a window are formed, at most."""
    *before, last = config.design.model.kind
    return sum(_of_kind(config, one) for one in before) + _of_columns(config, last)


def window_stages(config: WeakConfig) -> int:
    """Of a window with all its solves, at most."""
    theta = config.design.model.model
    own, hops = config.estimator, config.design.decimation * config.design.hop
    gain = own.feedback_hz * own.divider * hops / config.sample_rate
    rate = own.law is Law.PSEUDOVELOCITY or 0 < gain < 1
    projection = 2 + sum(1 + -(-theta.c_column.count(a) // _COLUMNS) for a in range(theta.n_p))
    solve = projection + 5 + -(-theta.n_theta // _ROWS)
    solves = solve + 1 + ((0 if rate else config.iterations - 1) * (solve + 1))
    of_kinds = sum(_of_kind(config, one) for one in config.design.model.kind)
    return of_kinds + 9 + theta.n_p + solves + 4 + theta.n_p


def shares_place(config: WeakConfig) -> bool:
    """Whether all columns of a window are formed before the next half's first block is added."""
    design, harmonics = config.design, config.design.highest + 1
    used = 2 if design.decimation >= _TWO_TICKS else 1
    free = _BLOCK * max(design.decimation - used, 1)  # ticks of a block that add harmonics or run stages
    items = -(-2 * harmonics // free)  # harmonics of such a tick
    ticks = (design.hop // _BLOCK - 1) * (free - -(-harmonics // items))
    stages_per_tick = -(-window_stages(config) // ticks)
    return column_stages(config) <= stages_per_tick * (free - -(-2 * harmonics // items))


def _reading_stages_q31(design: WeakDesignQ31) -> int:
    """Of a kind, up to the last that reads the window's sums."""
    harmonics = design.highest + 1
    return (
        _parts(len(design.noise), _ENTRIES_Q31)
        + _parts(harmonics, _HARMONICS_Q31)
        + _parts(harmonics, _ROOTS_Q31)
        + design.power
        + _parts(harmonics, _UNITS_Q31)
        + harmonics
    )


def column_stages_q31(design: WeakDesignQ31) -> int:
    """Until the sums of a window have been read, at most: where the noise is computed in every window."""
    *before, _ = design.model.kind
    noise = design.power + _parts(design.highest + 1, _SHARES_Q31) + 2 + len(design.noise)
    whole = _reading_stages_q31(design)
    for kind in before:
        project = sum(kind.columns - i for i in range(kind.nuisances)) or 1
        rows = _parts(kind.thetas + 1, _FORMATS_Q31) + _parts(design.functions, _RESIDUALS_Q31) + design.functions
        whole += noise + _reading_stages_q31(design) + kind.columns + project + rows + _END_PARTS_Q31 + 1
    return whole


def shares_place_q31(design: WeakDesignQ31) -> bool:
    """Whether they have been read before the next half's first block is added, at one stage a tick."""
    harmonics, ticks = design.highest + 1, _BLOCK_Q31 * max(design.decimation - 1, 1)
    joined = -(-2 * harmonics // -(-2 * harmonics // ticks))
    return column_stages_q31(design) <= max(ticks - joined, 0)
