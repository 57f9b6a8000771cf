"""The twin of a model's generated weak form: the tables of the engine with its functions in numpy."""

from __future__ import annotations

from pvid.base.recent import Recent
from pvid.codegen import numpy_f32
from pvid.codegen.c_text import banner
from pvid.codegen.twin_file import namespace, pattern_of
from pvid.codegen.weak import WeakFunctions, weak_functions_of
from pvid.model.compiled import CompiledModel
from pvid.settings.weak import WeakModel
from pvid.setup.weak_sizes import refuse_too_many_unknowns, sizes_of_model

_SUMMARIES = {
    "prepare": "Derivatives of the runs and arguments of sgn [results, ...] from the jets [jets, ...].",
    "values": "Gains and integrands [results, ...] from jets, runs and signs [inputs, ...].",
    "theta": "theta [n_theta, ...] from p [n_p, ...].",
    "jacobian": "Non-zeros of d theta / d p [n_c, ...] from p [n_p, ...].",
}


def text(made: WeakFunctions, command: str) -> str:
    """NAME_weak_twin.py."""
    parts = [
        f'"""Twin of {made.name}_weak_f32.c: {made.model.title}.\n\n'
        + "\n".join(banner(made.functions, command))
        + '\n"""',
        "from __future__ import annotations",
        "import numpy as np\nimport numpy.typing as npt\n\nfrom pvid.twin.f32 import elementary",
        "Float32 = npt.NDArray[np.float32]\n_F = np.float32",
    ]
    definitions = [
        numpy_f32.function(f"{one.name}_f32", one.program, _SUMMARIES[one.name]) for one in made.with_results
    ]
    return "\n\n".join(parts) + "\n\n\n" + "\n\n\n".join(definitions) + "\n"


def loaded(made: WeakFunctions) -> WeakModel:
    """The model for the twin and for designs."""
    space = namespace(text(made, "loaded"), made.name)
    return WeakModel(
        name=made.name,
        sample_names=made.samples,
        jet_names=made.jet_names,
        run_names=made.run_names,
        sign_names=made.sign_names,
        gain_names=made.gain_names,
        integrand_names=made.integrand_names,
        signal=made.signal,
        jet=made.jet,
        channel=made.channel,
        term=made.term,
        kind=made.kind,
        prepare=space.get("prepare_f32"),
        values=space["values_f32"],
        model=pattern_of(made.functions, space),
    )


@Recent
def weak_model_of(compiled: CompiledModel) -> WeakModel:
    """The tables and twin of a compiled model, without corners as given.

    Raises
    ------
    PvidError
        Where the engine does not have what the model needs.
    """
    refuse_too_many_unknowns(compiled)
    model = loaded(weak_functions_of(compiled))
    sizes_of_model(model)  # raises
    return model
