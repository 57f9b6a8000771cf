"""Real hardware whose recordings are in source archives of Python packages: pieces of them are in this repository.

`./tools/pvid bench kept-recordings --cut ARCHIVES` cuts them anew from the unpacked archives ARCHIVES/NAME-VERSION.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from bench.recordings import Measured, Package, Piece, Source

Float = npt.NDArray[np.float64]

_CLOCK = 1000.0  # samples in the unit of time of the motor's model: the clock is not published
_REST = 4000  # samples before the motor is first switched on
_SCALE = 1000.0  # of the generator's numbers
_SWITCHED = 5.0  # the input while the motor is on
_SWING_MIDDLE = 1.356  # [V] about which the fork's gyroscope swings
_MEAN = 5  # samples of the lift


def _switched_motor(path: Path, part: int) -> dict[str, Float]:
    """The generator's numbers of PATH less their value at rest; the input beside it."""
    del part
    y, u = (np.loadtxt(one, ndmin=1) for one in (path, path.with_name("x_cc.csv")))
    return {"t": np.arange(len(y)) / _CLOCK, "u": u / _SWITCHED, "y": (y - y[:_REST].mean()) / _SCALE}


def _gyroscope(path: Path, part: int) -> dict[str, Float]:
    from scipy.io import loadmat

    del part
    content = loadmat(path, squeeze_me=True)
    v = np.asarray(content["data"], dtype=np.float64)
    return {"t": np.arange(len(v)) / float(content["ActualRate"]), "v": v - _SWING_MIDDLE}


def _lift(path: Path, part: int) -> dict[str, Float]:
    """Means of five samples of the first joint; the file of the efforts is beside that of the positions."""
    del part
    positions, efforts = (
        np.loadtxt(one, delimiter=",", skiprows=1) for one in (path, path.with_name("tiago_effort.csv"))
    )
    whole = len(positions) // _MEAN * _MEAN
    columns = {"t": positions[:whole, 0], "q": positions[:whole, 1], "i": efforts[:whole, 1]}
    return {name: one.reshape(-1, _MEAN).mean(axis=1) for name, one in columns.items()}


_MOTOR = "examples/datasets/y_cc.csv"
_FORK = "bicycleparameters/tests/sample_data/BrowserForkCompoundFirst1.mat"
_LIFT = "tests/fixtures/tiago/data/identification/tiago_position.csv"

KEPT: tuple[Source, ...] = (
    Source(
        name="motor_generator",
        file="motor_generator.py",
        origin=Package("sysidentpy", "0.1.9", "LICENSE"),
        licence="BSD 3-Clause, Copyright (c) 2019, Wilson Rocha; Luan Pascoal; Samuel Oliveira; Samir Martins",
        read=_switched_motor,
        identify=Piece(_MOTOR, 40.0, 200.0),
        predict=Piece(_MOTOR, 210.0, 352.0),
        channels=(
            Measured("u", "", meaning="1: on, 0: off"),
            Measured("y", "", meaning="speed, numbers of the file / 1000"),
        ),
        rate=50.0,
        decimals={"u": 0, "y": 4},
        note=(
            "A DC motor that turns a second one as generator, switched by a random binary signal; from "
            "W. R. Lacerda Junior, V. M. Almeida, S. A. M. Martins, Identificacao de um motor/gerador CC por meio de "
            "modelos polinomiais autorregressivos e redes neurais artificiais, 2017, which the package names. u is the "
            "file x_cc.csv / 5. The package gives neither the unit of y nor the clock: a second is 1000 samples "
            "here. The value at rest, the mean of the first 4000 samples, is subtracted from y. Both pieces are of one "
            "run."
        ),
    ),
    Source(
        name="bicycle_fork",
        file="bicycle_fork.py",
        origin=Package("bicycleparameters", "1.5.2", "LICENSE.txt"),
        licence="BSD 2-Clause, Copyright (c) 2011-2026, BicycleParameters Authors",
        read=_gyroscope,
        # from where the rate is largest: there the angle, which is not measured, passes 0, where a simulation starts
        identify=Piece(_FORK, end=15.094),
        predict=Piece(_FORK, 15.094),
        channels=(Measured("v", "V", meaning="voltage of the rate gyroscope less 1.356 V"),),
        rate=200.0,
        decimals={"v": 4},
        note=(
            "The fork of a bicycle on a knife edge, a swing of 30 s. Both pieces are of this one swing: its first and "
            "its second half. The package's period for the fork in this position, TcF1 = 1.4811 s, is not that of this "
            "swing, whose period is 1.59 s; therefore no published value stands beside the identified ones."
        ),
    ),
    Source(
        name="torso_lift",
        file="torso_lift.py",
        origin=Package("figaroh", "1.0.2", "LICENSE"),
        licence="Apache 2.0, Copyright 2025-2026 Thanh D. V. Nguyen",
        read=_lift,
        identify=Piece(_LIFT, 14.0, 41.0),
        predict=Piece(_LIFT, 41.0, 67.5),
        channels=(
            Measured("q", "m", meaning="height of the torso"),
            Measured("i", "A", meaning="current of its motor"),
        ),
        rate=20.0,
        decimals={"i": 4, "q": 7},
        note=(
            "The torso of a TIAGo robot on its spindle, while the arm moves too; recorded by Thanh Nguyen / CNRS / "
            "Toward. Means of five samples at 100 Hz. The efforts are of tiago_effort.csv; the package multiplies them "
            "by a ratio and a motor constant, so they are taken for currents. Both pieces are of one run."
        ),
    ),
)
