"""PyBOP: a Thevenin cell with one RC element, least squares by L-BFGS-B with the solver's sensitivities."""

from __future__ import annotations

from bench.peers.rigs import NONE, Fit, Rig, Run, Values

PACKAGE = "pybop==26.3"
RIGS = ("cell",)


def fit(rig: Rig, run: Run, guess: Values) -> Fit:
    import pybamm
    import pybop

    names = {"R0": "R0 [Ohm]", "R1": "R1 [Ohm]", "C1": "C1 [F]", "E": "Open-circuit voltage [V]"}
    start = {"R0": guess["R0"], "R1": guess["R1"], "C1": guess["T1"] / guess["R1"], "E": guess["E"]}
    values = pybamm.equivalent_circuit.Thevenin().default_parameter_values
    values.update(
        {
            "Initial SoC": 0.5,
            "Cell capacity [A.h]": 1000.0,
            "Nominal cell capacity [A.h]": 1000.0,
            "Entropic change [V/K]": 0.0,
            "Upper voltage cut-off [V]": 10.0,
            "Lower voltage cut-off [V]": 0.0,
            "Element-1 initial overpotential [V]": 0.0,
            "Initial temperature [K]": 298.15,
            "Ambient temperature [K]": 298.15,
        }
    )
    for one, value in start.items():
        bounds = [value - 0.5, value + 0.5] if one == "E" else [value / 4, value * 4]
        log = None if one == "E" else pybop.LogTransformation()
        values[names[one]] = pybop.Parameter(initial_value=value, bounds=bounds, transformation=log)
    data = pybop.Dataset({"Time [s]": run["t"], "Current [A]": run["i"], "Voltage [V]": run["v"]})
    simulator = pybop.pybamm.Simulator(
        pybamm.equivalent_circuit.Thevenin(), values, protocol=data, solver=pybamm.IDAKLUSolver()
    )
    problem = pybop.Problem(simulator, pybop.SumSquaredError(data))
    found = pybop.SciPyMinimize(
        problem, options=pybop.SciPyMinimizeOptions(method="L-BFGS-B", jac=True, maxiter=200)
    ).run()
    best = {one: found.best_inputs[names[one]] for one in start}
    result = {"R0": best["R0"], "R1": best["R1"], "T1": best["C1"] * best["R1"], "E": best["E"]}
    return result, dict.fromkeys(result, NONE), ""
