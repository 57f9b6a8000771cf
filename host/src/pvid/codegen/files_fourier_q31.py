"""The tables of the fixed-point weak engine in C: a model and a design for pvid/fourier_q31.h."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from pvid.codegen.fourier_q31 import FixedFourier, c_functions
from pvid.codegen.parameters_q31 import ParametersQ31, c_parameters
from pvid.settings.fourier import NONE
from pvid.settings.fourier_q31 import FourierConfigQ31, FourierDesignQ31, Rescale

_WIDTH = 12  # numbers a line


def source(made: FixedFourier, parameters: ParametersQ31, design: FourierDesignQ31, prefix: str) -> str:
    """Functions, PREFIX_fourier_q31 and PREFIX_design_q31; all static but the design."""
    return "\n\n".join(
        [
            '#include "pvid/fourier_q31.h"\n#include "pvid/elementary_q31.h"\n\n#include <stddef.h>',
            c_functions(made, prefix).rstrip(),
            c_parameters(parameters, prefix).rstrip(),
            *_model(made, prefix),
            *_design(design, prefix),
        ]
    )


def _place(place: int) -> str:
    return "PVID_FOURIER_NONE" if place == NONE else str(place)


def _structs(kind: str, name: str, entries: Iterable[Sequence[object]]) -> str:
    lines = [f"    {{{', '.join(map(str, one))}}}," for one in entries]
    return "\n".join([f"static const {kind} {name}[{len(lines)}] = {{", *lines, "};"]) if lines else ""


def _numbers(kind: str, name: str, values: Iterable[int]) -> str:
    given = [str(int(one)) for one in values]
    rows = [f"    {', '.join(given[k : k + _WIDTH])}," for k in range(0, len(given), _WIDTH)]
    return "\n".join([f"static const {kind} {name}[{len(given)}] = {{", *rows, "};"]) if given else ""


def _model(made: FixedFourier, prefix: str) -> list[str]:
    model = made.model
    channels = [
        (_place(one.gain), _place(one.integrand), one.fold, _place(one.plain), _place(one.ramp))
        for one in model.channel
    ]
    kinds = [(one.thetas, one.nuisances, one.first, one.end) for one in model.kind]
    counts = {
        "samples": model.samples,
        "signals": len(model.signal),
        "jets": len(model.jet),
        "runs": model.runs,
        "signs": model.signs,
        "gains": model.gains,
        "integrands": model.integrands,
        "channels": len(model.channel),
        "kinds": len(model.kind),
    }
    tables = ("signal", "jet", "channel", "term", "kind")
    struct = [
        f"static const pvid_fourier_model_q31 {prefix}_fourier_q31 = {{",
        *(f"    .{name} = {count}," for name, count in counts.items()),
        *(f"    .{name} = {prefix}_{name}," for name in tables),
        f"    .prepare = {prefix + '_prepare_q31' if made.prepare else 'NULL'},",
        f"    .values = {prefix}_values_q31,",
        f"    .model = &{prefix}_model_q31,",
        "};",
    ]
    return [
        _structs("pvid_fourier_signal", f"{prefix}_signal", [(one.sample, int(one.source)) for one in model.signal]),
        _structs("pvid_fourier_jet", f"{prefix}_jet", [(one.signal, one.order) for one in model.jet]),
        _structs("pvid_fourier_channel", f"{prefix}_channel", channels),
        _structs("pvid_fourier_term_q31", f"{prefix}_term", [(x.channel, x.order, x.column) for x in model.term]),
        _structs("pvid_fourier_kind", f"{prefix}_kind", kinds),
        "\n".join(struct),
    ]


def _rescale(one: Rescale) -> str:
    return f"{{{one.down}, {one.shift}, {one.multiplier}}}"


def _design(design: FourierDesignQ31, prefix: str) -> list[str]:
    parts, filters = [], []
    for k, one in enumerate(design.filter):
        weights = f"{prefix}_weights_{k}" if one.half else "NULL"
        if one.half:
            parts.append(_numbers("PVID_TABLE int32_t", weights, one.weights))
        filters.append((one.half, one.bits, _rescale(one.rescale), weights))
    formats = [(one.value, one.own, one.plain, one.ramp) for one in design.format]
    tables = {
        "full_scale": _numbers("int32_t", f"{prefix}_full_scale", design.full_scale),
        "down": _numbers("uint8_t", f"{prefix}_down", design.down),
        "filter": _structs("pvid_fourier_filter_q31", f"{prefix}_filter", filters),
        "run": _structs(
            "pvid_fourier_rescale_q31", f"{prefix}_run", [(x.down, x.shift, x.multiplier) for x in design.run]
        ),
        "sign_width": _numbers("int32_t", f"{prefix}_sign_width", design.sign_width),
        "integral": _structs("pvid_fourier_integral_q31", f"{prefix}_integral", design.integral),
        "format": _structs("pvid_fourier_format_q31", f"{prefix}_format", formats),
        "factor": _structs("pvid_scaled_q31", f"{prefix}_factor", design.factor),
        "noise": _structs(
            "pvid_fourier_noise_q31",
            f"{prefix}_noise",
            [(x.kind, x.power, x.a, x.b, f"{{{x.factor[0]}, {x.factor[1]}}}") for x in design.noise],
        ),
        "error_order": _numbers("uint8_t", f"{prefix}_error_order", design.error_order),
        "error_variance": _structs("pvid_scaled_q31", f"{prefix}_error_variance", design.error_variance),
        "circle": _numbers("PVID_TABLE int16_t", f"{prefix}_circle", design.circle.tolist()),
    }
    sizes = ("functions", "power", "decimation", "sum_shift", "hop")
    struct = [
        f"extern const pvid_fourier_design_q31 {prefix}_design_q31;",
        f"const pvid_fourier_design_q31 {prefix}_design_q31 = {{",
        f"    .model = &{prefix}_fourier_q31,",
        *(f"    .{name} = {getattr(design, name)}," for name in sizes),
        f"    .n_noise = {len(design.noise)},",
        *(f"    .{name} = {prefix}_{name if text else ''}," for name, text in tables.items() if text),
        "};",
    ]
    return [*parts, *(text for text in tables.values() if text), "\n".join(struct)]


def configuration(config: FourierConfigQ31, prefix: str) -> str:
    """PREFIX_config_q31, behind the design."""
    own, trust, gate = config.estimator, config.trust, config.gate
    arrays = ("start", "start_sd", "lower", "upper", "p_bits", "n_bits")
    numbers = ("y_bits", "row_sd", "forgetting_groups", "gain", "correlation", "row_weight", "step_limit")
    more = ("kappa_min", "noise_margin", "dead_zone", "divider")
    of_trust = ("kappa_min", "se_max", "misfit_max", "groups_min", "revert_after", "renewal")
    parts = [_numbers("int32_t", f"{prefix}_offset", config.offset)]
    if config.drive_min is not None:
        parts.append(_numbers("int32_t", f"{prefix}_drive_min", config.drive_min))
    drive = f"{prefix}_drive_min" if config.drive_min is not None else "NULL"
    struct = [
        f"extern const pvid_fourier_config_q31 {prefix}_config_q31;",
        f"const pvid_fourier_config_q31 {prefix}_config_q31 = {{",
        f"    .design = &{prefix}_design_q31,",
        f"    .offset = {prefix}_offset,",
        f"    .drive_min = {drive},",
        f"    .iterations = {config.iterations},",
        "    .estimator = {",
        *(f"        .{name} = {{{', '.join(map(_literal, getattr(own, name)))}}}," for name in arrays),
        *(f"        .{name} = {getattr(own, name)}," for name in (*numbers, *more)),
        "    },",
        "    .trust = {" + ", ".join(f".{name} = {getattr(trust, name)}" for name in of_trust) + "},",
        f"    .gate = {{.sigmas = {gate.sigmas}, .patience_groups = {gate.patience_groups}}},",
        "};",
    ]
    return "\n\n".join([*parts, "\n".join(struct)])


def _literal(value: int) -> str:
    """Also of the least int32."""
    return "INT32_MIN" if value == -(2**31) else str(value)
