"""An angle that turns without end, as a count about a reference that follows it: nothing is lost by moving it.

The reference moves at every 37th tick: through all places of a block of steps, of a block
of samples and of a half window, while blocks are added and windows joined.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from pvid.codegen.weak import weak_functions_of
from pvid.codegen.weak_library import weak_native, weak_sources
from pvid.configuration.weak import config_for_simulated_rig, samples_of, simulated_run_of
from pvid.models.mechanisms import compiled_of
from pvid.twin.printed import PrintedTwin

EVERY = 37
OF_TWIN = 60  # stretches

# Mechanism -> the angle, how far its reference moves [largest sample], and the unit of that under a sine. The encoder
# of the PMSM is so fine that the rounding of a larger float32 counts.
ANGLES = {
    "dc_motor": ("phi", 2.0, 0.0),
    "coasting_motor": ("phi", 2.0, 0.0),
    "pmsm": ("th", 0.1, 0.0),
    "furuta": ("th", 20.0, 0.0),
    "free_pendulum": ("q", 8.0, 2 * np.pi),
}


def references(reach: float, turn: float, count: int) -> npt.NDArray[np.float64]:
    """One for each stretch of EVERY ticks, of the resolution of a float32 of the sum."""
    drawn = np.random.default_rng(5).uniform(-reach, reach, count)
    drawn[0] = 0.0
    return np.rint(drawn / turn) * turn if turn else np.rint(drawn * 2**10) / 2**10


@pytest.mark.parametrize("name", ANGLES)
def test_a_reference_moves_at_any_tick_and_the_estimate_stays(name: str) -> None:
    compiled = compiled_of(name)
    made, config = weak_functions_of(compiled), replace(config_for_simulated_rig(compiled), range=None)
    signal, far, turn = ANGLES[name]
    place = made.samples.index(signal)
    gain = made.gain_names.index(signal)
    channel = next(k for k, one in enumerate(made.channel) if one.gain == gain)
    samples = samples_of(config, simulated_run_of(compiled)[0])
    native = weak_native(compiled, config.design)
    whole = native.identifier_of(config).run_samples(samples)

    core: Any = native.identifier_of(config)
    twin = PrintedTwin(weak_sources(compiled, config.design), config)
    at = references(far * float(np.abs(samples[:, place]).max()), turn, -(-len(samples) // EVERY))
    record = None
    for k, reference in enumerate(at):
        piece = samples[k * EVERY : (k + 1) * EVERY].copy()
        if k:
            shift = np.float32(reference - at[k - 1])
            assert native.library.pvid_weak_rebase_f32(core.state, place, channel, float(shift))
            if k < OF_TWIN:
                assert twin.module.pvid_weak_rebase_f32(twin.state, place, channel, shift)
        piece[:, place] = (piece[:, place].astype(np.float64) - reference).astype(np.float32)
        record = core.run_samples(piece)
        if k < OF_TWIN:
            assert record.hash.tobytes() == twin.run(piece).hash.tobytes()
    assert record is not None
    n = len(compiled.unknowns)
    sd, other = whole.published_se[-1][:n], record.published_se[-1][:n]
    off = np.abs(record.published[-1] - whole.published[-1])[:n] / sd
    assert (off <= 0.5).all()  # the rounding of larger angles
    assert (np.abs(other / sd - 1) <= 0.2).all()


def test_only_an_angle_in_derivatives_alone_is_moved() -> None:
    compiled = compiled_of("dc_motor")
    made, config = weak_functions_of(compiled), config_for_simulated_rig(compiled)
    core = weak_native(compiled, config.design).identifier_of(config)
    rebase: Any = core.native.library.pvid_weak_rebase_f32
    assert made.turning == {made.samples.index("phi"): 1}
    before = bytes(core.native.headers.ffi.buffer(core.state))
    for sample, channel, shift in ((2, 0, 1.0), (2, 1, np.inf), (2, 1, np.nan), (3, 1, 1.0), (2, 99, 1.0), (0, 1, 1.0)):
        assert not rebase(core.state, sample, channel, shift)
    assert not rebase(core.native.headers.ffi.NULL, 2, 1, 1.0)
    assert bytes(core.native.headers.ffi.buffer(core.state)) == before
    assert rebase(core.state, 2, 1, 1.0)


def test_models_in_which_an_angle_itself_occurs_have_none_that_turns() -> None:
    turning = {name: weak_functions_of(compiled_of(name)) for name in ("free_pendulum", "furuta", "pmsm", "kapitza")}
    found = {name: [made.samples[k] for k in made.turning] for name, made in turning.items()}
    assert found == {"free_pendulum": [], "furuta": ["th"], "pmsm": ["th"], "kapitza": []}
