"""From a rig file to the settings of the fixed-point core."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.base.errors import PvidError
from pvid.design.strong_q31 import strong_design_q31
from pvid.rig.file import RigFile, Sensor
from pvid.rig.run import Run
from pvid.settings.enums import Law
from pvid.settings.f32 import EstimatorConfig, GateConfig
from pvid.settings.q31 import EstimatorConfigQ31, GateConfigQ31, ScaleQ31, StrongConfigQ31
from pvid.settings.tables import RATE_BITS, StrongDesignQ31
from pvid.setup.f32 import bank_of, nominal_start, strong_config
from pvid.setup.ranges_q31 import Beyond, beyond_ranges, middle_of_travel, reach, with_default_ranges, with_ranges_of

Float = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]

PATIENCE_MAX = 2**30  # groups of rows, of gate_q31.h
FORGETTING_MIN, FORGETTING_MAX = 4, 2**24  # likewise, of estimator_q31.h


def format_of(largest: float) -> int:
    """Bits after the point with which |x| <= largest fits an int32."""
    return math.floor(math.log2((2**31 - 2) / largest))


def _counting(rig: RigFile) -> Sensor:
    """The sensors of a rig with all ranges; their resolutions must be given."""
    sensor = with_default_ranges(rig)
    for name, lsb in (("phi_lsb", sensor.phi_lsb), ("y_lsb", sensor.y_lsb)):
        if not lsb > 0:
            raise PvidError(
                f"[sensor] {name} is 0, and the fixed-point core counts in it: set it to the sensor's resolution"
            )
    return sensor


def strong_design_of(rig: RigFile, sample_rate: float) -> StrongDesignQ31:
    """The strong form's formats of a rig file."""
    sensor = _counting(rig)
    w, d1, d2 = nominal_start(rig)
    mode = math.sqrt(w * (d1 + math.sqrt(max(d1**2 - 4 * d2, 0.0))) / 2)  # the faster one of the nominal mechanism
    # the motion is as fast as twice that, or as a drive that uses both of its ranges
    fastest = max(2 * mode, math.sqrt(sensor.acceleration_range / sensor.y_range))
    return strong_design_q31(
        bank_of(rig, sample_rate),
        sample_rate,
        rig.l1,
        sensor.phi_lsb,
        sensor.y_lsb,
        sensor.phi_range,
        sensor.y_range,
        sensor.acceleration_range,
        fastest,
        w,
        float(strong_config(rig, sample_rate).estimator.upper[0]),
    )


def counts_of(rig: RigFile, run: Run) -> tuple[Int64, Int64]:
    """Counts of a rig's sensors in a run: phi and y, both [ticks]."""
    return counts_of_samples(run.phi, rig.sensor.phi_lsb), counts_of_samples(run.y, rig.sensor.y_lsb)


def counts_of_samples(values: npt.NDArray[np.float64], lsb: float) -> Int64:
    """Counts as in a 32-bit register; NaN becomes the least count, which is beyond full scale."""
    counts = np.rint(np.nan_to_num(values / lsb, nan=-(2.0**31), posinf=2.0**31, neginf=-(2.0**31)))
    return np.clip(counts, -(2.0**31), 2.0**31 - 1).astype(np.int64)


def config_for_run(rig: RigFile, run: Run, start: npt.ArrayLike | None = None) -> StrongConfigQ31:
    """Settings for a run; ranges that are missing in the file contain it.

    Heights that do not fit about 0 are counted about the middle of their travel; the encoder's zero is the equilibrium.
    """
    rig = with_ranges_of(rig, run)
    config = strong_config_q31(rig, run.sample_rate, start)
    return replace(config, y_offset=_offset(counts_of(rig, run)[1], config.full_scale[1]))


def _offset(counts: Int64, limit: int) -> int:
    """Offset of a sensor [counts]: 0, if the median is within half of the full scale `limit` and the whole travel fits;
    else the middle of the travel, the median or 0, that with most samples in range."""
    ordinary = counts[np.abs(counts) < 2**31 - 1]
    middle, median = round(middle_of_travel(ordinary)), round(float(np.median(ordinary))) if len(ordinary) else 0
    if abs(median) <= limit // 2 and reach(ordinary.astype(np.float64), 0.0) <= limit:
        return 0
    return max((middle, median, 0), key=lambda at: int((np.abs(ordinary - at) <= limit).sum()))


def beyond_range(config: StrongConfigQ31, phi: Int64, y: Int64) -> Beyond:
    """Counts phi, y [n] beyond the ranges of this configuration."""
    return beyond_ranges(phi - config.phi_offset, y - config.y_offset, *config.full_scale)


def _estimator_q31(
    settings: EstimatorConfig,
    nominal: EstimatorConfig,
    unit: Float,
    n_bits: tuple[int, ...],
    y_bits: int,
    row_unit: float,
    w_bits: int | None = None,
    **own: int,
) -> EstimatorConfigQ31:
    """Settings of the estimator in integers.

    Parameters
    ----------
    settings
        Those of the float core; start, start_sd and row_sd among them.
    nominal
        Likewise for the nominal start, whose bounds, and with them formats, are those of every start: one program.
    unit
        Of p in SI [n_p].
    n_bits, y_bits
        Formats of a row.
    row_unit
        What Y is counted in, in SI.
    w_bits
        Format of p[0]; by default the one that its bounds fill.
    own
        Settings that the forms see differently.
    """
    n_p = len(unit)
    lower, upper, start, sd = (
        np.asarray(x, np.float64)[:n_p] / unit
        for x in (nominal.lower, nominal.upper, settings.start, settings.start_sd)
    )
    bits = [format_of(x) for x in np.maximum(np.abs(lower), upper)]
    bits[0] = bits[0] if w_bits is None else w_bits

    def integers(x: Float) -> tuple[int, ...]:
        return tuple(int(np.rint(v * 2.0**b)) for v, b in zip(x, bits, strict=True))

    return EstimatorConfigQ31(
        start=integers(start),
        start_sd=integers(sd),
        lower=tuple(max(1, x) if i < 3 else x for i, x in enumerate(integers(lower))),
        upper=integers(upper),
        p_bits=tuple(bits),
        n_bits=n_bits,
        y_bits=y_bits,
        row_sd=min(max(1, round(settings.row_sd / row_unit * 2.0 ** (y_bits + 8))), 2**31 - 1),
        step_limit=round(settings.step_limit * 2**16),
        kappa_min=round(settings.kappa_min * 2**30),
        dead_zone=round(settings.dead_zone * 2**16),
        divider=settings.divider,
        **own,
    )


def forgetting_groups_q31(forgetting_s: float, groups_hz: float) -> int:
    """The time constant of forgetting in rows or windows, which come at groups_hz; 0: none."""
    groups = round(forgetting_s * groups_hz)
    if forgetting_s > 0 and not FORGETTING_MIN <= groups <= FORGETTING_MAX:
        wrong = "short" if groups < FORGETTING_MIN else "long"
        raise PvidError(
            f"[identifier] forgetting_s = {forgetting_s:g} is too {wrong} for core q31, which forgets within 4 to 2^24 "
            f"rows or windows ({FORGETTING_MIN / groups_hz:.4g} to {FORGETTING_MAX / groups_hz:.4g} s here); 0: never"
        )
    return groups


def gate_config_q31(gate: GateConfig, groups_hz: float) -> GateConfigQ31:
    """The gate of the float core in integers, for rows or windows that come at groups_hz."""
    patience = gate.patience_s * groups_hz
    if patience > PATIENCE_MAX:
        raise PvidError(
            f"[identifier] outlier_patience_s = {gate.patience_s:g} is too long for core q31, which counts up to 2^30 "
            f"rows or windows ({PATIENCE_MAX / groups_hz:.4g} s here); 0: never"
        )
    return GateConfigQ31(round(gate.sigmas * 2**16), max(round(patience), 1) if patience > 0 else 0)


def strong_config_q31(rig: RigFile, sample_rate: float, start: npt.ArrayLike | None = None) -> StrongConfigQ31:
    """Settings of the strong form at `sample_rate` [Hz]; `start` overrides the nominal p."""
    design = strong_design_of(rig, sample_rate)
    config = strong_config(rig, sample_rate, start)
    e = config.estimator
    rate = sample_rate / design.bank.every  # of rows
    gain = e.feedback_hz * e.divider / rate if e.feedback_hz > 0 else 1.0
    estimator = _estimator_q31(
        e,
        strong_config(rig, sample_rate).estimator,
        design.p_units,
        (0,),
        0,
        design.row_angle / design.dt**8,
        w_bits=RATE_BITS + 1,
        forgetting_groups=forgetting_groups_q31(e.forgetting_s, rate),
        gain=0 if e.law is Law.PSEUDOVELOCITY else round(min(gain, 1.0) * 2**30),
        correlation=round(e.correlation * 2**16),
    )
    return StrongConfigQ31(
        design=design,
        estimator=estimator,
        drive_ticks=min(max(round(rate), 1), 2**30),
        gate=gate_config_q31(config.gate, rate),
        drive_min=min(round(config.drive_min * design.dt**2 * 2.0**RATE_BITS), 2**29),
    )


def units_of(config: StrongConfigQ31) -> Float:
    """One unit of each of the core's integers p in SI [n_p]."""
    bits = np.array(config.estimator.p_bits, np.float64)
    return np.asarray(config.design.p_units[: len(bits)] * 2.0**-bits)


def p_of(config: StrongConfigQ31, p: npt.ArrayLike) -> Float:
    """p = (w, d1, d2) in SI from the core's integers [..., n_p]."""
    return np.asarray(np.asarray(p, np.float64) * units_of(config))


def se_of(config: StrongConfigQ31, se: npt.ArrayLike) -> Float:
    """Standard errors in SI from the core's integers [..., n_p]."""
    return np.asarray(np.asarray(se, np.float64) * units_of(config))


def covariance_of(config: StrongConfigQ31, estimate: npt.NDArray[np.void]) -> Float:
    """Covariance of p in SI [..., n_p, n_p] from estimates of the core."""
    n_p = len(config.estimator.p_bits)
    se = se_of(config, estimate["se"][..., :n_p])
    correlation = np.asarray(estimate["correlation"], np.float64)[..., :n_p, :n_p] / 2**30
    return np.asarray(correlation * se[..., :, None] * se[..., None, :])


LENGTH_BITS = 24  # of pvid_kapitza_q31


def scale_of(config: StrongConfigQ31, l1: float) -> ScaleQ31:
    """Scale factors from the estimates of a configuration to metres, for a rod of l1 [m]."""
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
