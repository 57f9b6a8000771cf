"""`pvid simulate`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np

from pvid.base.console import DONE, write_stderr
from pvid.base.replacing import refuse_foreign
from pvid.cli.input import NewFile, force_option
from pvid.rig.file import rig_path_of
from pvid.rig.mechanism_file import MechanismRig
from pvid.rig.run import write_run
from pvid.sim.pendulum import (
    STANDARD_DRIVE,
    STANDARD_PENDULUM,
    STANDARD_RELEASE,
    Pendulum,
    Sensors,
    Tone,
    simulate,
    standard_sensors,
)


def tone(text: str) -> Tone:
    try:
        amplitude, frequency, phase = (float(part) for part in text.split(","))
    except ValueError as error:
        raise click.BadParameter(f"{text!r} is not AMPLITUDE_M,FREQUENCY_HZ,PHASE_RAD") from error
    return Tone(amplitude, frequency, phase)


@click.command(name="simulate")
@click.argument("out", type=NewFile())
@click.option("--duration", default=40.0, show_default=True, help="Length [s].")
@click.option("--rate", default=1000.0, show_default=True, help="Sample rate [Hz].")
@click.option("--truth", type=click.Choice(["linear", "full"]), default="full", show_default=True)
@click.option("--bits", default=14, show_default=True, type=click.IntRange(4, 32), help="Encoder resolution.")
@click.option("--exact", is_flag=True, help="Perfect sensors: no quantisation, no noise, no offset.")
@click.option("--noise", type=float, help="White noise of the encoder [LSB].  [default: 0.5]")
@click.option("--zero", default=0.0, show_default=True, help="Offset of the encoder [rad].")
@click.option("--skew", default=0.0, show_default=True, help="Delay of the pivot's sample behind the encoder's [s].")
@click.option("--tone", "tones", multiple=True, metavar="A,F,PHASE", help="Drive tone [m,Hz,rad]; repeatable.")
@click.option(
    "--release",
    nargs=2,
    type=float,
    default=STANDARD_RELEASE,
    show_default=True,
    help="Initial phi1, phi1+phi [rad].",
)
@click.option("--l1", default=STANDARD_PENDULUM.l1, show_default=True, help="Length of rod 1 [m].")
@click.option("--l2", default=STANDARD_PENDULUM.l2, show_default=True, help="Joint to centre of mass of body 2 [m].")
@click.option("--rho2", default=STANDARD_PENDULUM.rho2, show_default=True, help="Radius of gyration of body 2 [m].")
@click.option("--gravity", default=STANDARD_PENDULUM.g, show_default=True, help="Gravity [m/s^2].")
@click.option("--tilt", default=0.0, show_default=True, help="Tilt of the plane of motion [rad].")
@click.option(
    "--damping", default=0.0, show_default=True, help="Viscous friction of both joints per unit mass [m^2/s]."
)
@click.option("--dry", default=0.0, show_default=True, help="Dry friction of both joints per unit mass [m^2/s^2].")
@click.option("--slant", default=0.0, show_default=True, help="Of the pivot's slide against the vertical [rad].")
@click.option("--seed", default=0, show_default=True)
@click.option("--rig", "rig_out", type=NewFile(), help="Rig file to write.  [default: OUT with .toml]")
@force_option
def command(**options: Any) -> int:
    """Simulates a rig; writes the run OUT (.csv, .csv.gz, .npz, .parquet) and its rig file."""
    pendulum = Pendulum(
        l1=options["l1"],
        l2=options["l2"],
        rho2=options["rho2"],
        g=options["gravity"],
        damping1=options["damping"],
        damping2=options["damping"],
        dry1=options["dry"],
        dry2=options["dry"],
        slant=options["slant"],
    ).tilted(options["tilt"])
    sensors = standard_sensors(options["bits"])
    if options["exact"]:
        sensors = Sensors()
    if options["noise"] is not None:
        sensors = replace(sensors, phi_noise_lsb=options["noise"])
    sensors = replace(sensors, phi_zero=options["zero"], skew_s=options["skew"])
    drive = tuple(tone(text) for text in options["tones"]) or STANDARD_DRIVE
    simulation = simulate(
        pendulum=pendulum,
        drive=drive,
        sensors=sensors,
        sample_rate=options["rate"],
        duration=options["duration"],
        release=tuple(options["release"]),
        truth=options["truth"],
        seed=options["seed"],
    )
    out: Path = options["out"]
    rig_path: Path = options["rig_out"] or rig_path_of(out)
    refuse_foreign(rig_path)
    write_run(out, simulation.run)
    exact = {"gain_sd": 0.0} | ({"resolution": sensors.y_lsb} if sensors.y_lsb else {})
    angle = {"resolution": sensors.phi_lsb} if sensors.phi_lsb else {}
    rig = MechanismRig(
        "kapitza",
        options["rate"],
        known={"l1": pendulum.l1},
        sensor={"phi": angle, "y": exact},
        known_sd={"l1": 0.0},
        clock_sd=0.0,
    )
    rig.write(rig_path)
    largest = float(np.abs(simulation.run.phi).max())
    write_stderr(f"{out}: {len(simulation.run.t)} samples, |phi| up to {largest:.3f} rad; rig file {rig_path}")
    return DONE
