"""The weak forms of all shipped mechanisms: their designs, and their C in one library."""

from dataclasses import dataclass
from functools import cache

from bench.kinds import KINDS
from pvid.codegen import files_weak
from pvid.codegen.weak import WeakFunctions, weak_functions_of, weak_model_of
from pvid.codegen.weak_sizes import sizes_of_design
from pvid.configuration.weak_tables import config_of, design_tables, for_core
from pvid.core.model_library import ModelSources
from pvid.core.sizes import raised
from pvid.core.weak_native import WeakNative
from pvid.models import mechanisms
from pvid.models.simulated_rig import simulated_rig
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.identify import ready
from pvid.oracle.weak.rows import WeakRows
from pvid.settings.weak import WeakConfig, WeakModel
from pvid.sim.simulated_run import RigSimulation

NAMES = KINDS


@dataclass(frozen=True)
class WeakForm:
    """A shipped mechanism with the design of its rig.

    Attributes
    ----------
    run : samples of its simulated rig
    rows : of the oracle, with the identifier's design
    config : the tables, and settings
    """

    made: WeakFunctions
    model: WeakModel
    run: dict[str, Float]
    rows: WeakRows
    truth: Float
    config: WeakConfig

    @property
    def files(self) -> dict[str, str]:
        """Name -> text of the generated C."""
        name, needed = self.made.name, sizes_of_design(self.config.design)
        return {
            f"{name}_weak.h": files_weak.header(self.made, self.model, needed, "test"),
            f"{name}_weak_f32.c": files_weak.source(self.made, self.model, "test"),
            f"{name}_design_f32.h": files_weak.design_header(self.config, self.made.model, "test"),
        }


@cache
def weak_form(name: str) -> WeakForm:
    """Of a shipped mechanism."""
    compiled, rig = mechanisms.compiled_of(name), simulated_rig(name)
    simulation = RigSimulation.of(compiled, rig)
    run = simulation.run()
    model = ready(compiled)
    design = for_core(WeakDesign(rig.sample_rate, rig.window_s, **rig.design))  # type: ignore[arg-type]
    rows = WeakRows.of(model, run, design)
    tables = design_tables(weak_model_of(compiled), rows, simulation.truth)
    return WeakForm(
        weak_functions_of(compiled),
        weak_model_of(compiled),
        run,
        rows,
        simulation.truth,
        config_of(tables, rig.sample_rate, model.parameters),
    )


@cache
def sizes_of_all() -> dict[str, int]:
    """That hold every shipped design."""
    every = [sizes_of_design(weak_form(name).config.design) for name in NAMES]
    return {macro: max(one[macro] for one in every) for macro in every[0]}


@cache
def native(name: str) -> WeakNative:
    """A mechanism in the library of all."""
    texts = {
        file: text for one in NAMES for file, text in weak_form(one).files.items() if not file.endswith("_design_f32.h")
    }
    sources = ModelSources("all", texts, raised(sizes_of_all()))
    return WeakNative(name, sources.library(), sources)
