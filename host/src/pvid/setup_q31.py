"""From a rig file to the settings of the fixed-point core."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.capture import Run
from pvid.errors import PvidError
from pvid.native import Law
from pvid.native_q31 import EstimatorConfigQ31, ScaleQ31, WeakConfigQ31
from pvid.rigfile import RigFile
from pvid.setup import weak_config, weak_design_of
from pvid.weak_design_q31 import WeakTablesQ31, weak_tables_q31

Int64 = npt.NDArray[np.int64]


def format_of(largest: float) -> int:
    """Bits after the point with which |x| <= largest fits an int32."""
    return math.floor(math.log2((2**31 - 2) / largest))


def tables_of(rig: RigFile, sample_rate: float) -> WeakTablesQ31:
    """The tables a rig file asks for."""
    sensor = rig.sensor
    for name, lsb in (("phi_lsb", sensor.phi_lsb), ("y_lsb", sensor.y_lsb)):
        if not lsb > 0:
            raise PvidError(
                f"[sensor] {name} is 0, and the fixed-point core counts in it: say what the sensor resolves"
            )
    return weak_tables_q31(
        weak_design_of(rig, sample_rate),
        sensor.phi_lsb,
        sensor.y_lsb,
        sensor.phi_range,
        sensor.y_range or rig.l1 / 10,
        sensor.acceleration_range or 4 * rig.nominal.g,
    )


def counts_of(rig: RigFile, run: Run) -> tuple[Int64, Int64]:
    """What the sensors of a rig count in a run: phi and y, both [ticks]."""
    return _counts(run.phi, rig.sensor.phi_lsb), _counts(run.y, rig.sensor.y_lsb)


def _counts(values: npt.NDArray[np.float64], lsb: float) -> Int64:
    """As a 32-bit register holds them; what is not a number is as far beyond full scale as can be."""
    counts = np.rint(np.nan_to_num(values / lsb, nan=-(2.0**31), posinf=2.0**31, neginf=-(2.0**31)))
    return np.clip(counts, -(2.0**31), 2.0**31 - 1).astype(np.int64)


def config_for_run(rig: RigFile, run: Run, start: npt.ArrayLike | None = None) -> WeakConfigQ31:
    """Settings for a run, its first sample taken for rest where that is nearer than 0."""
    if rig.identifier.form != "weak":
        raise PvidError("core q31 has the weak form only: use --form weak, or --core f32")
    if rig.identifier.full_angle or rig.identifier.damping:
        raise PvidError("core q31 has neither full_angle nor damping: use --core f32")
    config = weak_config_q31(rig, run.sample_rate, start)
    phi, y = counts_of(rig, run)
    half = config.design.phi_max // 2, config.design.y_max // 2
    first = [int(c[0]) if len(c) and abs(int(c[0])) > limit else 0 for c, limit in zip((phi, y), half, strict=True)]
    return replace(config, phi_offset=first[0], y_offset=first[1])


def weak_config_q31(rig: RigFile, sample_rate: float, start: npt.ArrayLike | None = None) -> WeakConfigQ31:
    """Settings of the weak form at `sample_rate` [Hz]; `start` overrides the nominal p."""
    tables = tables_of(rig, sample_rate)
    float_config = weak_config(rig, sample_rate, start)
    e = float_config.estimator
    n_p = 4 if float_config.zero_unknown else 3
    unit = np.array([1 / tables.dt**2, 1.0, 1.0, tables.f_unit])[:n_p]  # of p, in SI
    # bounds, and with them formats, are the nominal start's: one program for every start
    nominal = weak_config(rig, sample_rate).estimator
    lower = np.asarray(nominal.lower, np.float64)[:n_p] / unit
    upper = np.asarray(nominal.upper, np.float64)[:n_p] / unit
    start_p = np.asarray(e.start, np.float64)[:n_p] / unit
    sd = np.asarray(e.start_sd, np.float64)[:n_p] / unit
    bits = [format_of(x) for x in np.maximum(np.abs(lower), upper)]

    def integers(x: npt.NDArray[np.float64]) -> tuple[int, ...]:
        return tuple(int(np.rint(v * 2.0**b)) for v, b in zip(x, bits, strict=True))

    functions = tables.functions
    y_bits = tables.column_bits[8]
    estimator = EstimatorConfigQ31(
        start=integers(start_p),
        start_sd=integers(sd),
        lower=tuple(max(1, x) if i < 3 else x for i, x in enumerate(integers(lower))),
        upper=integers(upper),
        p_bits=tuple(bits),
        n_bits=tables.column_bits[: 8 if n_p == 4 else 5],
        y_bits=y_bits,
        row_sd=max(1, round(e.row_sd / tables.f_unit * 2.0 ** (y_bits + 8))),
        forgetting_groups=round(e.forgetting_s * sample_rate / (tables.decimation * float_config.hop)),
        gain=0 if e.law is Law.PSEUDOVELOCITY else 2**30,
        correlation=round(tables.overlap * 2**16),
        row_weight=round((functions - 2) / functions * 2**16),
        step_limit=round(e.step_limit * 2**16),
        kappa_min=round(e.kappa_min * 2**30),
        divider=e.divider,
    )
    return WeakConfigQ31(
        design=tables,
        estimator=estimator,
        zero_unknown=float_config.zero_unknown,
        iterations=float_config.iterations,
        drive_min=round(float_config.drive_min * tables.dt**2 * 2.0**tables.u_bits),
    )


def units_of(config: WeakConfigQ31) -> npt.NDArray[np.float64]:
    """One unit of each of the core's integers p in SI [n_p]."""
    bits = np.array(config.estimator.p_bits, np.float64)
    unit = np.array([1 / config.design.dt**2, 1.0, 1.0, config.design.f_unit])[: len(bits)]
    return np.asarray(unit * 2.0**-bits)


def p_of(config: WeakConfigQ31, p: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """p = (w, d1, d2, c) in SI from the core's integers [..., n_p]; c is the encoder's reading at rest."""
    values = np.asarray(p, np.float64) * units_of(config)
    if values.shape[-1] > 3:
        lsb = config.design.f_unit * 2.0 ** (config.design.smooth_bits - config.design.phi_shift)
        values[..., 3] += config.phi_offset * lsb
    return np.asarray(values)


def se_of(config: WeakConfigQ31, se: npt.ArrayLike) -> npt.NDArray[np.float64]:
    """Standard errors in SI from the core's integers [..., n_p]."""
    return np.asarray(np.asarray(se, np.float64) * units_of(config))


def covariance_of(config: WeakConfigQ31, estimate: npt.NDArray[np.void]) -> npt.NDArray[np.float64]:
    """Covariance of p in SI [..., n_p, n_p] from estimates of the core."""
    n_p = len(config.estimator.p_bits)
    se = se_of(config, estimate["se"][..., :n_p])
    correlation = np.asarray(estimate["correlation"], np.float64)[..., :n_p, :n_p] / 2**30
    return np.asarray(correlation * se[..., :, None] * se[..., None, :])


LENGTH_BITS = 24  # of pvid_kapitza_q31


def scale_of(config: WeakConfigQ31, l1: float) -> ScaleQ31:
    """What turns the estimates of a configuration into metres for a rod of l1 [m]."""
    if not 2.0**-LENGTH_BITS <= l1 < 2.0 ** (31 - LENGTH_BITS):
        raise PvidError(f"l1 = {l1:g} m does not fit the fixed-point core's lengths, which end at 127 m")
    mantissa, exponent = math.frexp(units_of(config)[0] * l1 * 2.0**LENGTH_BITS)
    return ScaleQ31(
        l1=round(l1 * 2.0**LENGTH_BITS),
        g_multiplier=min(round(mantissa * 2.0**31), 2**31 - 1),
        g_shift=31 - exponent,
        d1_bits=config.estimator.p_bits[1],
        d2_bits=config.estimator.p_bits[2],
    )
