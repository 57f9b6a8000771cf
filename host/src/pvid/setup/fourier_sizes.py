"""Which PVID_MAX_ sizes of the core a model and a design of the weak engine need."""

from __future__ import annotations

from pvid.settings.fourier import FourierDesign32, FourierModel


def sizes_of_model(model: FourierModel) -> dict[str, int]:
    """Macro -> least value."""
    thetas = [one.thetas for one in model.kind]
    return {
        "PVID_MAX_THETA": model.model.n_theta,
        "PVID_MAX_P": model.model.n_p,
        "PVID_MAX_MOMENTS": sum(n * (n + 1) // 2 for n in thetas),
        "PVID_MAX_SAMPLES": model.samples,
        "PVID_MAX_INPUTS": model.jets + model.runs + model.signs,
        "PVID_MAX_CHANNELS": max(model.channels, model.gains),
        "PVID_MAX_INTEGRANDS": max(model.integrands, model.runs, model.signs),
        "PVID_MAX_KINDS": model.kinds,
        "PVID_MAX_COLUMNS": max(one.columns for one in model.kind),
    }


def sizes_of_design(design: FourierDesign32) -> dict[str, int]:
    """Those of its model among them."""
    return sizes_of_model(design.model) | {
        "PVID_MAX_RING": design.model.signals * (4 * design.half_steps + 5),
        "PVID_MAX_HARMONICS": design.highest + 1,
        "PVID_MAX_FUNCTIONS": design.functions,
        "PVID_MAX_POWER": design.power,
        "PVID_MAX_DECIMATION": design.decimation,
    }
