"""Runs through the binding: a simulation's arguments, sampling, advancing, settling."""

import math

import numpy as np
import pytest
from module_common import INF, N_B, N_P, make_model, make_simulation, refused, same_bits

from beltdyn import _core
from beltdyn.errors import SimulationError

# --- Simulation: arguments ---------------------------------------------------------------------


def test_the_model_must_be_one(model, rest):
    with pytest.raises(TypeError, match=r"must be beltdyn\._core\.Model, not dict"):
        _core.Simulation({}, rest, [], 1.0)
    with pytest.raises(TypeError, match=r"must be beltdyn\._core\.Model, not None"):
        _core.Simulation.settle(None)
    with pytest.raises(TypeError, match="positional"):
        _core.Simulation(model, rest, [], 1.0, "tsit5")
    with pytest.raises(TypeError, match="positional"):
        _core.Simulation.settle(model, None, True)
    with pytest.raises(TypeError, match=r"unexpected keyword|invalid keyword"):
        make_simulation(model, rest, tolerance=1.0)


def test_method(model, rest):
    assert make_simulation(model, rest, rtol=1e-8).method == "tsit5"
    assert make_simulation(model, rest, rtol=1e-2).method == "rodas4"
    assert make_simulation(model, rest, method="rk4").method == "rk4"
    with pytest.raises(ValueError, match=r'method must be .* got "euler"'):
        make_simulation(model, rest, method="euler")
    with refused(TypeError, "method must be a str, got bytes"):
        make_simulation(model, rest, method=b"rk4")
    with refused(ValueError, "method must not contain a null character"):
        make_simulation(model, rest, method="rk4\0")
    with pytest.raises(UnicodeEncodeError):
        make_simulation(model, rest, method="\udc80")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rtol": 0.0}, "rtol must be > 0"),
        ({"rtol": math.nan}, "rtol must be > 0"),
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
    with pytest.raises(ValueError, match=words):
        make_simulation(model, rest, **options)


def test_options_reach_the_core(model, rest):
    simulation = make_simulation(model, rest, method="rk4", step=1e-5)
    assert simulation.advance(INF) is True
    assert simulation.stats["largest_step"] == pytest.approx(1e-5, rel=1e-6)
    simulation = make_simulation(model, rest, max_step=2e-5)
    assert simulation.advance(INF) is True
    assert simulation.stats["largest_step"] <= 2e-5
    stats = [make_simulation(model, rest, rtol=rtol) for rtol in (1e-4, 1e-6)]
    assert all(simulation.advance(INF) for simulation in stats)
    assert stats[1].stats["steps"] > stats[0].stats["steps"]


def test_breakpoints_are_hit(model, rest):
    at = []

    def torque(t, theta, omega):
        at.append(t)
        return [0.0, 0.0]

    simulation = make_simulation(model, rest, [("call", torque)], breakpoints=[0.0123, 0.017])
    assert simulation.advance(INF) is True
    # a step ends and one begins there, each seen from its own side
    assert {np.nextafter(t, side) for t in (0.0123, 0.017) for side in (0, 1)} <= set(at)


def test_stats_and_passes(model, rest):
    simulation = make_simulation(model, rest)
    assert simulation.stats["steps"] == 0
    assert simulation.advance(INF) is True
    stats = simulation.stats
    assert stats["steps"] > 10 and stats["nfev"] > stats["steps"]
    assert type(stats["steps"]) is int and type(stats["smallest_step"]) is float
    assert isinstance(simulation.passes, tuple)
    assert any("friction" in name for name in simulation.passes)
    assert len(make_simulation(make_model(gravity=(0, -9.81)), rest).passes) == (
        len(simulation.passes) + 1
    )


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
        (0.0, ValueError, "t_eval must have shape (n,), got ()"),
        ([[0.0]], ValueError, "t_eval must have shape (n,), got (1, 1)"),
        ([0.0, math.nan], ValueError, "t_eval[1] must be finite, got nan"),
        (None, TypeError, "t_eval must hold real numbers, got dtype object"),
        ([1j], TypeError, "t_eval must hold real numbers, got dtype complex128"),
    ],
)
def test_sample_refuses(model, rest, t, kind, message):
    simulation = make_simulation(model, rest)
    with refused(kind, message):
        simulation.sample(t)
    assert simulation.sample([])["theta"].shape == (0, N_P)


@pytest.mark.parametrize("t", [[-0.1], [0.0, 0.03], [0.01, 0.0]])
def test_sample_times_within_the_run(model, rest, t):
    simulation = make_simulation(model, rest)
    with pytest.raises(ValueError, match="non-decreasing and within"):
        simulation.sample(t)
    samples = simulation.sample([0.02])
    assert simulation.advance(INF) is True and np.isfinite(samples["x"]).all()


def test_sample_times_are_set_once_and_early(model, rest):
    simulation = make_simulation(model, rest)
    simulation.sample([0.0])
    with refused(RuntimeError, "the sample times are set already"):
        simulation.sample([0.0])
    simulation = make_simulation(model, rest)
    simulation.advance(0.0)
    with refused(RuntimeError, "sample times must be set before the run"):
        simulation.sample([0.0])


def test_the_sample_times_are_copied(model, rest):
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


def test_advance_returns_in_between(model, rest):
    simulation = make_simulation(model, rest, t_end=1e5)
    assert simulation.advance(0.02) is False
    assert 0.0 < simulation.time < 1e5


@pytest.mark.parametrize("value", [-1.0, math.nan, -INF])
def test_seconds_must_be_positive(model, rest, value):
    with refused(ValueError, f"seconds must be >= 0, got {value!r}"):
        make_simulation(model, rest).advance(value)


# --- settling ----------------------------------------------------------------------------------


def test_settle_comes_to_rest(rest):
    for name in ["vx", "vy", "vphi", "omega"]:
        assert not rest[name].any()
    assert rest["t"] == 0.0 and rest["x"].shape == (N_B,)


def test_settle_from_a_state(model, rest):
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
        ({"offset": [0.0, 0.0]}, ValueError, "offset must have shape (2, 2), got (2,)"),
        ({"offset": [[0, 0]] * 3}, ValueError, "offset must have shape (2, 2), got (3, 2)"),
        ({"offset": [[0, 0], [0, math.nan]]}, ValueError, "offset[1, 1] must be finite, got nan"),
        ({"offset": "near"}, TypeError, "offset must hold real numbers, got dtype <U4"),
    ],
)
def test_settle_refuses(model, options, kind, message):
    with refused(kind, message):
        _core.Simulation.settle(model, **options)


def test_settle_rules_of_the_core(model):
    with pytest.raises(ValueError, match="tolerance must be > 0"):
        _core.Simulation.settle(model, tolerance=0.0)
    with pytest.raises(ValueError, match="max_time must be finite and >= 0"):
        _core.Simulation.settle(model, max_time=-1.0)
    with pytest.raises(ValueError, match="shift must be at most the belt's length"):
        _core.Simulation.settle(model, shift=math.inf)
    with pytest.raises(ValueError, match="overlap"):
        _core.Simulation.settle(make_model(centers=[(0, 0), (0.1, 0)]))
    with pytest.raises(RuntimeError, match="settling has no samples"):
        _core.Simulation.settle(model).sample([0.0])


def test_settle_that_does_not_end(model):
    settling = _core.Simulation.settle(model, tolerance=1e-9, max_time=1e-3)
    with pytest.raises(SimulationError, match="did not come to rest") as caught:
        settling.advance(INF)
    assert caught.value.symbol == "BD_ERR_NOT_SETTLED" and caught.value.value > 0
