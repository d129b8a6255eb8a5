"""Runs through the binding: a simulation's arguments, sampling, advancing, settling."""

import math

import numpy as np
import pytest
from module_common import INF, N_B, N_P, make_model, make_simulation, refused, same_bits

from beltdyn import _core
from beltdyn.errors import SimulationError

V, T = ValueError, TypeError

# --- Simulation: arguments ---------------------------------------------------------------------


def test_the_model_must_be_one_and_options_are_keywords(model, rest):
    for call, words in (
        (lambda: _core.Simulation({}, rest, [], 1.0), r"must be beltdyn\._core\.Model, not dict"),
        (lambda: _core.Simulation.settle(None), r"must be beltdyn\._core\.Model, not None"),
        (lambda: _core.Simulation(model, rest, [], 1.0, "tsit5"), "positional"),
        (lambda: _core.Simulation.settle(model, None, True), "positional"),
        (lambda: make_simulation(model, rest, tolerance=1.0), "(unexpected|invalid) keyword"),
    ):
        with pytest.raises(T, match=words):
            call()


def test_method(model, rest):
    for options, name in (
        ({"rtol": 1e-8}, "tsit5"), ({"rtol": 1e-2}, "rodas4"), ({"method": "rk4"}, "rk4"),
    ):  # fmt: skip
        assert make_simulation(model, rest, **options).method == name
    for name, kind, words in (
        ("euler", V, 'method must be .* got "euler"'),
        (b"rk4", T, "^method must be a str, got bytes$"),
        ("rk4\0", V, "^method must not contain a null character$"),
        ("\udc80", UnicodeEncodeError, "surrogates not allowed"),
    ):
        with pytest.raises(kind, match=words):
            make_simulation(model, rest, method=name)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rtol": 0.0}, "rtol must be > 0"),
        ({"rtol": math.nan}, "rtol must be > 0"),
        ({"rtol": 1.0001}, "rtol must be > 0 and <= 1"),
        ({"step": -1.0}, "step must be finite and >= 0"),
        ({"max_step": INF}, "max_step must be finite and >= 0"),
        ({"max_steps": -1}, "max_steps must be >= 0"),
        ({"t_end": 0.0}, "t_end must be finite and later than the start"),
        ({"t_end": INF}, "^t_end must be finite, got inf$"),
        ({"breakpoints": [math.nan]}, r"^breakpoints\[0\] must be finite, got nan$"),
        ({"breakpoints": 0.1}, r"^breakpoints must have shape \(n,\), got \(\)$"),
    ],
)
def test_options_out_of_range(model, rest, options, words):
    with pytest.raises(V, match=words):
        make_simulation(model, rest, **options)


def test_options_reach_the_core(model, rest):
    def stats(**options):
        simulation = make_simulation(model, rest, **options)
        assert simulation.stats["steps"] == 0
        assert simulation.advance(INF) is True
        return simulation.stats

    assert stats(method="rk4", step=1e-5)["largest_step"] == pytest.approx(1e-5, rel=1e-6)
    assert stats(max_step=2e-5)["largest_step"] <= 2e-5
    coarse = stats(rtol=1e-4)
    assert stats(rtol=1e-6)["steps"] > coarse["steps"] > 10 and coarse["nfev"] > coarse["steps"]
    assert type(coarse["steps"]) is int and type(coarse["smallest_step"]) is float
    passes, heavy = (
        make_simulation(one, rest).passes for one in (model, make_model(gravity=(0, -9.81)))
    )
    assert isinstance(passes, tuple) and len(heavy) == len(passes) + 1
    assert any("friction" in name for name in passes)


def test_breakpoints_are_hit(model, rest):
    at = []

    def torque(t, theta, omega):
        at.append(t)
        return [0.0, 0.0]

    simulation = make_simulation(model, rest, [("call", torque)], breakpoints=[0.0123, 0.017])
    assert simulation.advance(INF) is True
    # a step ends and one begins there, each seen from its own side
    assert {np.nextafter(t, side) for t in (0.0123, 0.017) for side in (0, 1)} <= set(at)


# --- sampling and running ----------------------------------------------------------------------


def test_sample_shapes(model, rest):
    simulation = make_simulation(model, rest)
    samples = simulation.sample([0.0, 0.01, 0.02])
    widths = {"LINKS": N_B, "FRICTION": N_B, "PULLEYS": N_P, "ENERGY": len(model.energy_terms)}
    absent = {"drag_loss", "mount", "mount_loss", "path_work"}  # without drag and mounts
    columns = [name for name, *_ in _core.ENERGY_TERMS if name not in absent]
    assert model.energy_terms == tuple(columns)
    rows = [row for row in _core.OUTPUTS if row[2] != "MOUNTS"]
    for name, _, size, *_ in rows:
        shape = (3, N_P, 2) if size == "PLANE" else (3, widths[size])
        assert samples[name].shape == shape and samples[name].dtype == np.float64
        assert np.isnan(samples[name]).all() and samples[name].flags.c_contiguous
    assert samples["pulley"].dtype == np.int32 and samples["pulley"].shape == (3, N_B)
    assert (samples["pulley"] == -1).all() and simulation.samples == 0
    assert simulation.advance(INF) is True and simulation.samples == 3
    for name, *_ in rows:
        assert np.isfinite(samples[name]).all(), name
    assert set(samples["pulley"].ravel()) == {-1, 0, 1}
    final = simulation.state()
    for name in ["x", "y", "phi", "vx", "vy", "vphi", "theta", "omega"]:
        np.testing.assert_array_equal(samples[name][-1], final[name])
        np.testing.assert_array_equal(samples[name][0], rest[name])


def test_rows_come_one_by_one(model, rest):
    simulation = make_simulation(model, rest, max_steps=20)
    samples = simulation.sample(np.linspace(0.0, 0.02, 201))
    with pytest.raises(SimulationError, match="max_steps"):
        simulation.advance(INF)
    done = simulation.samples
    assert 0 < done < 201
    assert np.isfinite(samples["x"][:done]).all() and np.isnan(samples["x"][done:]).all()
    assert (samples["pulley"][done:] == -1).all()


def test_no_ledger_no_energy(model, rest):
    simulation = make_simulation(model, rest, ledger=False)
    samples = simulation.sample([0.0])
    assert "energy" not in samples and "x" in samples
    assert simulation.advance(INF) is True


@pytest.mark.parametrize(
    ("t", "kind", "message"),
    [
        (0.0, V, r"^t_eval must have shape \(n,\), got \(\)$"),
        ([[0.0]], V, r"^t_eval must have shape \(n,\), got \(1, 1\)$"),
        ([0.0, math.nan], V, r"^t_eval\[1\] must be finite, got nan$"),
        (None, T, "^t_eval must hold real numbers, got dtype object$"),
        ([1j], T, "^t_eval must hold real numbers, got dtype complex128$"),
        ([-0.1], V, "non-decreasing and within"),
        ([0.0, 0.03], V, "non-decreasing and within"),
        ([0.01, 0.0], V, "non-decreasing and within"),
    ],
)
def test_sample_times_that_are_refused_do_not_harm(model, rest, t, kind, message):
    simulation = make_simulation(model, rest)
    with pytest.raises(kind, match=message):
        simulation.sample(t)
    samples = simulation.sample([0.02])
    assert simulation.advance(INF) is True and np.isfinite(samples["x"]).all()


def test_sample_times_are_copied_and_set_once_and_early(model, rest):
    simulation = make_simulation(model, rest)
    assert simulation.sample([])["theta"].shape == (0, N_P)
    with refused(RuntimeError, "the sample times are set already"):
        simulation.sample([0.0])
    simulation = make_simulation(model, rest)
    simulation.advance(0.0)
    with refused(RuntimeError, "sample times must be set before the run"):
        simulation.sample([0.0])
    t = np.array([0.01, 0.02])
    simulation = make_simulation(model, rest)
    samples = simulation.sample(t)
    t[:] = math.nan
    assert simulation.advance(INF) is True and np.isfinite(samples["x"]).all()


def test_chunks_do_not_matter(model, rest, driven):
    simulation = make_simulation(model, rest)
    times = [simulation.time]
    while not simulation.advance(0):
        times.append(simulation.time)
    assert len(times) > 3 and times == sorted(set(times)) and simulation.time == 0.02
    assert same_bits(simulation.state(), driven)
    assert simulation.advance(0) is True and simulation.advance(INF) is True
    simulation = make_simulation(model, rest, t_end=1e5)
    assert simulation.advance(0.02) is False and 0.0 < simulation.time < 1e5
    for value in [-1.0, math.nan, -INF]:
        with refused(V, f"seconds must be >= 0, got {value!r}"):
            simulation.advance(value)


# --- settling ----------------------------------------------------------------------------------


def test_settle_comes_to_rest_and_goes_on_from_a_state(model, rest):
    for name in ["vx", "vy", "vphi", "omega"]:
        assert not rest[name].any()
    assert rest["t"] == 0.0 and rest["x"].shape == (N_B,)
    settling = _core.Simulation.settle(model, rest, tolerance=1e-4)
    assert isinstance(settling, _core.Simulation)
    assert settling.advance(INF) is True
    np.testing.assert_allclose(settling.state()["x"], rest["x"], atol=1e-5)


def test_settle_with_moving_centres(model):
    offset = np.array([[0.0, 0.0], [-0.02, 0.0]])
    settling = _core.Simulation.settle(
        model, offset=offset, move_time=0.05, friction=True, free_pulleys=True, tolerance=1e-3
    )
    offset[:] = math.nan
    assert settling.passes[0] == "moving centres"
    assert settling.advance(INF) is True
    assert settling.state()["mu"].any()


@pytest.mark.parametrize(
    ("options", "kind", "message"),
    [
        ({"offset": [0.0, 0.0]}, V, r"^offset must have shape \(2, 2\), got \(2,\)$"),
        ({"offset": [[0, 0]] * 3}, V, r"^offset must have shape \(2, 2\), got \(3, 2\)$"),
        ({"offset": [[0, 0], [0, math.nan]]}, V, r"^offset\[1, 1\] must be finite, got nan$"),
        ({"offset": "near"}, T, "^offset must hold real numbers, got dtype <U4$"),
        ({"tolerance": 0.0}, V, "tolerance must be > 0"),
        ({"max_time": -1.0}, V, "max_time must be finite and >= 0"),
        ({"shift": INF}, V, "shift must be at most the belt's length"),
        ({"model": make_model(centers=[(0, 0), (0.1, 0)])}, V, "overlap"),
    ],
)
def test_settle_refuses(model, options, kind, message):
    with pytest.raises(kind, match=message):
        _core.Simulation.settle(**({"model": model} | options))


def test_settling_has_no_samples_and_may_not_end(model):
    settling = _core.Simulation.settle(model, tolerance=1e-9, max_time=1e-3)
    with pytest.raises(RuntimeError, match="settling has no samples"):
        settling.sample([0.0])
    with pytest.raises(SimulationError, match="did not come to rest") as caught:
        settling.advance(INF)
    assert caught.value.symbol == "BD_ERR_NOT_SETTLED" and caught.value.value > 0
