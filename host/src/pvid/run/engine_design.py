"""The weak engine's design and settings for a rig: from a recording of it, or from a shipped rig's simulation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from pvid.codegen.fourier_twin import fourier_model_of
from pvid.model.compiled import CompiledModel
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.fourier.choice import chosen
from pvid.oracle.fourier.design import FourierDesign
from pvid.oracle.fourier.functions import Float
from pvid.oracle.fourier.gate import gated
from pvid.oracle.fourier.identify import ready
from pvid.oracle.fourier.rows import WeakRows
from pvid.rig.run import Recording
from pvid.settings.fourier import FourierConfig
from pvid.setup.fourier import config_of, design_tables, for_engine
from pvid.sim.simulated_run import RigSimulation

Run = Mapping[str, npt.ArrayLike]


def engine_config(compiled: CompiledModel, run: Run, design: FourierDesign, p: Float | None = None) -> FourierConfig:
    """Settings of the engine for a rig, from a run of it.

    Parameters
    ----------
    run : name of each signal -> samples [n]
    design : of the oracle; the engine gets the nearest one that it has
    p : parameters near those of the rig [n_p]; None: the guesses

    Raises
    ------
    PvidError
        Where the engine does not have what the model or the design needs.
    """
    model = ready(compiled)
    tables_of = fourier_model_of(compiled)
    rows = WeakRows.of(model, run, for_engine(design))
    fit = gated(rows, p)
    tables = design_tables(tables_of, rows, fit.p, fit.errors)
    return config_of(tables, design.sample_rate, model.parameters)


def config_for_recording(compiled: CompiledModel, recording: Recording, functions: int | None = None) -> FourierConfig:
    """Settings for the rig that made a recording; the oracle chooses the design.

    Parameters
    ----------
    functions : K; None: chosen
    """
    design = chosen(ready(compiled), recording.signals, recording.sample_rate)
    return engine_config(compiled, recording.signals, _with(design, functions))


def config_for_simulated_rig(compiled: CompiledModel, functions: int | None = None) -> FourierConfig:
    """Settings for the shipped rig of a mechanism, with its own design.

    Raises
    ------
    PvidError
        Where the mechanism has no shipped rig.
    """
    rig = simulated_rig(compiled.name)
    simulation = RigSimulation.of(compiled, rig)
    run = simulation.run()
    design = FourierDesign(rig.sample_rate, rig.window_s, **rig.design)  # type: ignore[arg-type]
    return engine_config(compiled, run, _with(design, functions), np.asarray(simulation.truth))


def samples_of(config: FourierConfig, run: Run) -> npt.NDArray[np.float32]:
    """The argument of step at every tick [ticks, samples]."""
    return np.stack([np.asarray(run[name], np.float32) for name in config.design.model.sample_names], axis=1)


def _with(design: FourierDesign, functions: int | None) -> FourierDesign:
    return design if functions is None else replace(design, functions=functions)
