"""Natural names of signals and parameters are allowed, also those of the generated code's own arrays."""

import pytest

from pvid.model import Model, sin


@pytest.mark.parametrize("signal", ["theta", "lambda", "pi", "jacobian", "p", "in", "phi"])
@pytest.mark.parametrize("unknown", ["theta_0", "theta", "psi", "E", "I"])
def test_model_with_natural_names_compiles(signal: str, unknown: str) -> None:
    if signal == unknown or unknown.startswith(f"{signal}_"):
        pytest.skip("one name for two things")
    model = Model("pendulum")
    q = model.sensor(signal, "rad", resolution=1e-3)
    w = model.unknown(unknown, "1/s^2", 20.0)
    model.equation(q.d(2) + w * sin(q))
    compiled = model.compiled("pendulum")
    assert compiled.p_names == (unknown,) and [one.name for one in compiled.signals] == [signal]
