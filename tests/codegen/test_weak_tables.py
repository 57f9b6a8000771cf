"""The tables of the weak core say what the float64 oracle computes: an emulation in float64 reads nothing else."""

from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
import sympy as sp
from weak_forms import NAMES, WeakForm, weak_form
from weak_rig import noise_in_c

from pvid.base.errors import PvidError
from pvid.codegen.generated import GeneratedModel
from pvid.codegen.weak import weak_functions_of
from pvid.codegen.weak_library import weak_native
from pvid.configuration.weak import samples_of, weak_tables
from pvid.configuration.weak_tables import config_of, design_tables, for_core
from pvid.model import Integral, Model
from pvid.models.mechanisms import compiled_of
from pvid.oracle.weak.channels import running_integrals
from pvid.oracle.weak.design import WeakDesign
from pvid.oracle.weak.functions import Float
from pvid.oracle.weak.reversals import averaged
from pvid.settings.enums import Reason
from pvid.settings.weak import NONE, Source
from pvid.sim.imperfections import Imperfections
from pvid.sim.simulated_run import simulation_of

Complex = npt.NDArray[np.complex128]

# Weights of the filters and the circle are float32.
ROUNDING = 2e-5


class Emulation:
    """The identifier in float64, from its tables and the places of the oracle's steps."""

    def __init__(self, form: WeakForm) -> None:
        self.form, self.design, self.model = form, form.config.design, form.model
        self.places = form.rows.record.grid.places
        self.dt = form.config.dt

    def signals(self) -> list[Float]:
        out = []
        for one in self.model.signal:
            x = np.asarray(self.form.run[self.model.sample_names[one.sample]], np.float64)
            if one.source is Source.HELD:
                e = np.concatenate([x[:1], x[:1], x, x[-1:]])
                x = (-e[:-3] + 13 * e[1:-2] + 13 * e[2:-1] - e[3:]) / 24
            elif one.source is Source.JUMP:
                x = np.diff(x, prepend=x[:1]) / (12 * self.form.config.sample_rate)
            elif one.source is Source.LAST:
                x = np.concatenate([x[:1], x[:-1]])
            out.append(x)
        return out

    def jets(self) -> list[Float]:
        signals, out = self.signals(), []
        for jet, one in zip(self.model.jet, self.design.filter, strict=True):
            x, centre = signals[jet.signal], signals[jet.signal][self.places]
            total = centre if jet.order == 0 else np.zeros(len(centre))
            for i, weight in enumerate(one.weights.astype(np.float64), 1):
                newer, older = x[self.places + i], x[self.places - i]
                total = total + weight * (newer - older if jet.order % 2 else newer + older - 2 * centre)
            out.append(total)
        return out

    def values(self) -> tuple[Float, Float]:
        """Gains and integrands [.., steps], from the generated expressions."""
        jets = dict(zip(self.model.jet_names, self.jets(), strict=True))
        prepared = self._called(self.form.made.prepare.expressions, jets)
        runs, signs = prepared[: self.model.runs], prepared[self.model.runs :]
        given = dict(jets)
        for k, rate in enumerate(runs):
            # The oracle begins at the first sample; the core at the first step.
            whole = running_integrals(rate, len(rate) - 1, 1, self.dt)[1][0]
            oracle = self.form.rows.record.arguments[len(jets) + k]
            given[f"run_{k}"] = whole + oracle[0]
        for k, v in enumerate(signs):
            given[f"sgn_of_{k}"] = averaged(v, 0.0, np.zeros(1)).values
        both = self._called(self.form.made.values.expressions, given)
        return np.array(both[: self.model.gains]), np.array(both[self.model.gains :])

    @staticmethod
    def _called(expressions: tuple[sp.Expr, ...], given: dict[str, Float]) -> list[Float]:
        symbols = sorted(set().union(*(one.free_symbols for one in expressions)), key=str)
        values = sp.lambdify(symbols, expressions, "numpy")(*[given[str(one)] for one in symbols])
        size = len(next(iter(given.values())))
        return [np.broadcast_to(np.asarray(one, np.float64), size) for one in values]

    def sums(self) -> Complex:
        """S_h of every channel and window [channels, windows, H + 1]."""
        gains, integrands = self.values()
        hop, top = self.design.hop, self.design.highest
        circle = self.design.circle.astype(np.float64)
        halves = gains.shape[1] // hop
        places = np.outer(np.arange(hop), np.arange(top + 1)) % (2 * hop)
        turn = circle[places + hop // 2] + 1j * circle[places]
        half_sums = []
        ends = []
        for one in self.model.channel:
            gain = np.ones(gains.shape[1]) if one.gain == NONE else gains[one.gain]
            f = np.ones(gains.shape[1]) if one.integrand == NONE else integrands[one.integrand]
            running = running_integrals(f, hop, max(one.fold, 1), self.dt)
            ends.append([running[m][:, -1] for m in range(1, len(running))])
            values = gain[: halves * hop].reshape(halves, hop) * (running[one.fold][:, :-1] if one.fold else 1.0)
            half_sums.append(values @ turn)
        out = []
        for own, one, end in zip(half_sums, self.model.channel, ends, strict=True):
            second = own[1:].copy()
            if one.fold == 1:
                second += end[0][:-1, None] * half_sums[one.plain][1:]
            if one.fold == 2:
                second += end[1][:-1, None] * half_sums[one.plain][1:]
                second += end[0][:-1, None] * half_sums[one.ramp][1:]
            out.append(own[:-1] + second * (-1.0) ** np.arange(top + 1))
        return np.array(out)

    def columns(self) -> list[Float]:
        """Of each kind [windows, columns, K]."""
        sums, functions = self.sums(), self.form.rows.functions
        rates = functions.rates[functions.highest :]
        out = []
        for kind, about in enumerate(self.model.kind):
            whole = np.zeros((about.columns, *sums.shape[1:]), np.complex128)
            for one in self.model.term[self.model.kind[kind].first : self.model.kind[kind].end]:
                whole[one.column] += float(one.factor) * (-1j * rates) ** one.order * sums[one.channel]
            flat = np.empty((*whole.shape[:-1], 2 * functions.highest + 1))
            flat[..., 0] = whole[..., 0].real
            flat[..., 1::2], flat[..., 2::2] = whole[..., 1:].real, whole[..., 1:].imag
            out.append((flat @ functions.combine(0)).transpose(1, 0, 2))
        return out


@pytest.mark.parametrize("name", NAMES)
def test_columns_from_the_tables_are_those_of_the_oracle(name: str) -> None:
    form = weak_form(name)
    for own, oracle in zip(Emulation(form).columns(), form.rows.columns, strict=True):
        size = np.sqrt(np.mean(oracle**2, axis=(0, 2)))
        off = np.sqrt(np.mean((own - oracle) ** 2, axis=(0, 2)))
        assert np.all(off <= ROUNDING * size), (name, off / size)


@pytest.mark.parametrize("name", NAMES)
def test_noise_by_harmonics_is_the_covariance_of_the_rows(name: str) -> None:
    form = weak_form(name)
    functions, rows = form.rows.functions, form.rows
    theta = rows.compiled.parameters.theta(form.truth)
    basis, rates = functions.combine(0), functions.rates[functions.highest :]
    for kind in range(rows.kinds):
        own = np.append(theta[kind], -1.0)
        spectrum = np.zeros(functions.highest + 1)
        for one in form.config.design.noise_of(kind):
            spectrum += float(one.factor) * own[one.a] * own[one.b] * rates ** (2 * one.power)
        assert np.all(spectrum[1:] > 0) and spectrum[0] >= 0  # 0: all noise of the row is that of derivatives
        energy = functions.hop * np.concatenate([2 * spectrum[:1], np.repeat(spectrum[1:], 2)])
        covariance = basis.T @ (energy[:, None] * basis)
        oracle = noise_in_c(rows).covariance(kind, theta[kind], kind, theta[kind])
        scale = np.sqrt(np.diag(oracle))
        assert np.max(np.abs(covariance - oracle) / np.outer(scale, scale)) < 1e-5


def test_every_entry_of_the_noise_counts() -> None:
    """Without any one of the pendulum's entries the spectrum is another somewhere."""
    form = weak_form("kapitza")
    rates = form.rows.functions.rates[form.rows.functions.highest :]
    own = np.append(form.rows.compiled.parameters.theta(form.truth)[0], -1.0)
    shares = np.array(
        [float(one.factor) * own[one.a] * own[one.b] * rates ** (2 * one.power) for one in form.config.design.noise]
    )
    assert np.all(np.max(np.abs(shares) / shares.sum(axis=0), axis=1) > 4e-7)
    assert len({(one.power, one.a, one.b) for one in form.config.design.noise}) == len(shares) > 10


def test_overlapping_windows_inflate_variances_by_less_than_two() -> None:
    """2 for windows that all see the same motion; measured on the run less, where the motion is another in each."""
    for name in NAMES:
        assert 1.2 < weak_form(name).config.design.overlap < 2.001


def test_a_recording_limits_its_samples() -> None:
    """Ranges of all; the least motion in half a window of each sensor, of a measured drive where the rows need its
    derivative, of what the run may hold none."""
    for name in ("kapitza", "dc_motor", "battery_2rc"):
        form = weak_form(name)
        config = config_of(form.config.design, 1000.0, form.rows.compiled.parameters, run=form.run)
        assert config.range is not None and form.config.range is None
        largest = [float(np.max(np.abs(form.run[one]))) for one in form.model.sample_names]
        assert (config.range >= 1.49 * np.array(largest)).all()
        signals = {one.name: one for one in form.rows.compiled.bare.signals}
        least = {"y": 4 * signals["y"].sd} if name == "kapitza" else {}
        assert config.drive_min is not None
        assert dict(zip(form.model.sample_names, config.drive_min, strict=True)) == {
            one: np.float32(least.get(one, 0.0 if signals[one].driven else signals[one].resolution))
            for one in form.model.sample_names
        }


def test_integrals_have_the_channels_that_shift_them() -> None:
    model = weak_form("kapitza").model
    twice = [one for one in model.channel if one.fold == 2]
    assert len(twice) == 4
    for one in twice:
        plain, ramp = model.channel[one.plain], model.channel[one.ramp]
        assert (plain.gain, plain.fold) == (one.gain, 0)
        assert (ramp.gain, ramp.integrand, ramp.fold, ramp.plain) == (one.gain, NONE, 1, one.plain)
    assert model.channel[-1].gain == NONE  # the constant is the last one: it is not summed
    assert all(one.gain != NONE for one in model.channel[:-1])


def test_the_nearest_design_of_the_identifier() -> None:
    design = for_core(WeakDesign(1000.0, 0.501, 16, decimation=3, rate_taps=21, joint=True))
    assert (design.hop, design.joint, design.reversals) == (80, False, "averaged")
    assert design.window_s == pytest.approx(0.48)
    short = for_core(WeakDesign(1000.0, 0.026, 16))  # 13 steps a half, 11 harmonics
    assert short.hop == 24
    assert for_core(WeakDesign(1000.0, 1.0, 16, reversals="soft", soft=0.1)).reversals == "soft"


def test_the_core_drops_the_windows_that_the_oracle_leaves_out() -> None:
    """Those in which a motor's dry friction is in doubt for too long; with averaged signs all of them count."""
    compiled = compiled_of("dc_motor")
    run = simulation_of("dc_motor").run(0, Imperfections(friction="sharp"))
    decided = WeakDesign(1000.0, 0.208, 16, rate_taps=11, rate_degree=2, reversals="decided")
    made = weak_tables(compiled, run, decided)
    config = config_of(made.tables, 1000.0, made.rows.compiled.parameters, run=run)
    assert config.design.sign_doubt is not None and 0.1 < config.design.sign_doubt[0] < 3.0
    sizes = made.rows.record.grid.size // config.design.hop - 1
    left_out = sizes - made.rows.windows
    record = weak_native(compiled, config.design).identifier_of(config).run_samples(samples_of(config, run))
    solved = np.isin(record.reason, (Reason.UPDATED, Reason.HELD_UNCERTAIN, Reason.MISFIT, Reason.HELD_NOT_EXCITED))
    assert left_out > 10
    assert abs(int(np.sum(record.reason == Reason.HELD_NOT_EXCITED)) - left_out) <= 2  # the first windows' solves
    assert abs(int(solved.sum()) - sizes) <= 2
    plain = weak_tables(compiled, run, replace(decided, reversals="averaged"))
    assert plain.rows.windows == sizes and plain.tables.sign_doubt is None


def test_a_design_that_the_identifier_does_not_have_is_refused() -> None:
    form = weak_form("dc_motor")
    located = WeakDesign(1000.0, 0.5, 16)
    rows = type(form.rows).of(form.rows.compiled, form.run, located)
    with pytest.raises(PvidError, match="dc_motor: this design is none of the identifier's"):
        design_tables(form.model, rows, form.truth)


def _twice() -> Model:
    model = Model("charge twice")
    i, v = model.sensor("i", "A", resolution=1e-3), model.sensor("v", "V", resolution=1e-3)
    z = model.define("z", "A*s^2", Integral(i, 2))
    model.equation(v - model.unknown("s", "V/(A*s^2)", 1.0) * z - model.unknown("E", "V", 1.0))
    return model


def test_a_model_that_the_identifier_cannot_sum_is_refused_in_one_sentence() -> None:
    compiled = _twice().compiled("twice")
    with pytest.raises(PvidError, match="since the start of the run: the weak identifier integrates once"):
        weak_functions_of(compiled)
    assert "integrates once" in (GeneratedModel(compiled, "test").weak.refusal or "")
