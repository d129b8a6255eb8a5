"""States, torques and runs through the binding: arguments, sampling, advancing, settling."""

import collections
import ctypes
import math
from fractions import Fraction

import numpy as np
import pytest
from module_common import (
    INF,
    LAYOUTS,
    N_B,
    N_P,
    TORQUE,
    Broken,
    kind_of,
    make_model,
    make_simulation,
    refused,
    same_bits,
    strange_layouts,
)

from beltdyn import _core
from beltdyn.result.errors import SimulationError

V, T = ValueError, TypeError


def test_a_jacobian_that_is_not_finite_is_an_error(model, rest):
    with pytest.raises(SimulationError, match="the Jacobian is not finite at this state"):
        model.jacobian({**rest, "vy": rest["vy"] + 1e308})


def test_rate(model, rest):
    state = {**rest, "omega": np.array([0.5, -1.0]), "vx": np.linspace(-1, 1, N_B)}
    rate = model.rate(state, [3.0, 0.0])
    sizes = {"LINKS": N_B, "SLOTS": N_B, "STATES": N_B, "PULLEYS": N_P}
    for name, size, *_ in _core.STATE_FIELDS:
        assert rate[name].shape == (sizes.get(size, 0),) and rate[name].dtype == np.float64
    np.testing.assert_array_equal(rate["theta"], state["omega"])
    np.testing.assert_array_equal(rate["x"], state["vx"])
    more = model.rate(state, [4.0, 0.0])
    assert more["omega"][0] - rate["omega"][0] == pytest.approx(1.0 / 0.01)
    assert more["omega"][1] == rate["omega"][1]
    rate["x"][0] = 7.0
    assert model.rate(state, [3.0, 0.0])["x"][0] == -1.0
    for torque, kind, message in (
        ([0, 0, 0], V, "torque must have shape (2,), got (3,)"),
        ([INF, 0], V, "torque[0] must be finite, got inf"),
        (None, T, "torque must hold real numbers, got dtype object"),
    ):
        with refused(kind, message):
            model.rate(rest, torque)


def refused_by_all(model, state, kind, message):
    """By everything that takes a state."""
    for use in (
        lambda: model.rate(state, [0, 0]),
        lambda: _core.Simulation(model, state, [], 1.0),
        lambda: _core.Simulation.settle(model, state),
    ):
        with refused(kind, message):
            use()


OF_SOME = ("MOUNTS", "COUPLINGS", "CELLS", "MODES", "ALONG", "FLOW")
#: What a drive of links without mounts has; what it has none of may be left out.
FIELDS = [row[:2] for row in _core.STATE_FIELDS if row[1] not in OF_SOME]


@pytest.mark.parametrize(("name", "size"), FIELDS)
def test_states_are_whole_and_have_their_shapes(model, rest, name, size):
    n = N_P if size == "PULLEYS" else N_B
    lacking = {key: value for key, value in rest.items() if key != name}
    refused_by_all(model, lacking, V, f"state lacks '{name}'")
    nan_at_1 = np.where(np.arange(n) == 1, math.nan, 0.0)
    for value, kind, message in (
        (np.zeros(n - 1), V, f" must have shape ({n},), got ({n - 1},)"),
        (0.0, V, f" must have shape ({n},), got ()"),
        (nan_at_1, V, "[1] must be finite, got nan"),
        (None, T, " must hold real numbers, got dtype object"),
    ):
        refused_by_all(model, {**rest, name: value}, kind, f"state '{name}'{message}")


class Lazy(collections.UserDict):
    """A mapping that is no dict."""

    def __missing__(self, name):
        raise LookupError("mine")


def test_states_may_be_any_mapping(model, rest):
    assert same_bits(model.rate(Lazy(rest), [0, 0]), model.rate(rest, [0, 0]))
    with pytest.raises(LookupError, match="mine"):
        model.rate(Lazy({}), [0, 0])
    for value in [3, [1.0], (1.0,), "state", b"state", np.zeros(3), np.float64(1.0)]:
        got = f"state must be a mapping of arrays by name, got {kind_of(value)}"
        refused_by_all(model, value, T, got)
    without = {key: value for key, value in rest.items() if key != "t"}
    refused_by_all(model, without, V, "state lacks 't'")
    refused_by_all(model, {**rest, "t": math.nan}, V, "state 't' must be finite, got nan")
    refused_by_all(model, {**rest, "t": "0"}, T, "state 't' must be a real number, got str")


@pytest.mark.parametrize("layout", LAYOUTS)
def test_states_are_copied_from_any_layout(model, rest, layout):
    names = rest.keys() - {"t"}
    state = {"t": 0.0} | {name: strange_layouts(rest[name].copy())[layout] for name in names}
    assert same_bits(model.rate(state, [1, 2]), model.rate(rest, [1, 2]))
    simulation = make_simulation(model, state)
    if layout != "read-only":
        state["x"][:] = [math.nan] * N_B
    copied = simulation.state()
    assert same_bits(copied, rest)
    copied["x"][:] = math.nan
    assert simulation.advance(INF) is True and np.isfinite(simulation.state()["x"]).all()


def test_state_numbers_of_other_widths_but_none_that_would_lose_digits(model, rest):
    for dtype in ["f2", "f4", ">f4", "i1", "i8", ">i2", "u8"]:
        omega = np.array([2, 3]).astype(dtype)
        taken = make_simulation(model, {**rest, "omega": omega}).state()["omega"]
        assert taken.dtype == np.dtype(float) and taken.tolist() == [2.0, 3.0], dtype
    wide = np.zeros(N_P, np.longdouble)
    if wide.itemsize > 8:
        message = f"state 'omega' must hold real numbers, got dtype {wide.dtype}"
        refused_by_all(model, {**rest, "omega": wide}, T, message)


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
    for call, words in (
        (lambda: _core.Simulation({}, rest, [], 1.0), r"must be beltdyn\._core\.Model, not dict"),
        (lambda: _core.Simulation.settle(None), r"must be beltdyn\._core\.Model, not None"),
        (lambda: _core.Simulation(model, rest, [], 1.0, "tsit5"), "positional"),
        (lambda: _core.Simulation.settle(model, None, True), "positional"),
        (lambda: make_simulation(model, rest, tolerance=1.0), "(unexpected|invalid) keyword"),
    ):
        with pytest.raises(T, match=words):
            call()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"rtol": math.nan}, "rtol must be > 0"),
        ({"rtol": 1.0001}, "rtol must be > 0 and <= 1"),
        ({"max_step": INF}, "max_step must be finite and >= 0"),
        ({"max_steps": -1}, "max_steps must be >= 0"),
        ({"t_end": 0.0}, "t_end must be finite and later than the start"),
        ({"t_end": INF}, "^t_end must be finite, got inf$"),
        ({"breakpoints": [math.nan]}, r"^breakpoints\[0\] must be finite, got nan$"),
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
    at = []

    def torque(t, theta, omega):
        at.append(t)
        return [0.0, 0.0]

    simulation = make_simulation(model, rest, [("call", torque)], breakpoints=[0.0123, 0.017])
    assert simulation.advance(INF) is True
    # a step ends and one begins there, each seen from its own side
    assert {np.nextafter(t, side) for t in (0.0123, 0.017) for side in (0, 1)} <= set(at)


def test_samples(model, rest):
    """Their shapes; rows come one by one; times are copied, and set once and early."""
    times = np.linspace(0.0, 0.02, 201)
    simulation = make_simulation(model, rest)
    samples = simulation.sample(times)
    times[:] = math.nan
    widths = dict.fromkeys(("LINKS", "NODES", "JOINTS", "CONTACT", "FRICTION", "SLIPS"), N_B)
    widths |= {"PULLEYS": N_P, "ENERGY": len(model.energy_terms)}
    absent = {"drag_loss", "mount", "mount_loss", "path_work", "coupling", "coupling_loss"}
    columns = [name for name, *_ in _core.ENERGY_TERMS if name not in absent]
    assert model.energy_terms == tuple(columns)
    rows = [row for row in _core.OUTPUTS if row[2] not in OF_SOME]
    for name, _, size, *_ in rows:
        shape = (201, N_P, 2) if size == "PLANE" else (201, widths[size])
        assert samples[name].shape == shape and samples[name].dtype == np.float64
        assert np.isnan(samples[name]).all() and samples[name].flags.c_contiguous
    assert samples["pulley"].dtype == np.int32 and samples["pulley"].shape == (201, N_B)
    assert simulation.samples == 0
    with refused(RuntimeError, "the sample times are set already"):
        simulation.sample([0.0])
    done = 0
    while True:
        assert np.isfinite(samples["x"][:done]).all() and np.isnan(samples["x"][done:]).all()
        assert (samples["pulley"][done:] == -1).all()
        if done == 201:
            break
        simulation.advance(0.0)
        done = simulation.samples
    for name, *_ in rows:
        assert np.isfinite(samples[name]).all(), name
    assert set(samples["pulley"].ravel()) == {-1, 0, 1}
    final = simulation.state()
    for name in ["x", "y", "phi", "vx", "vy", "vphi", "theta", "omega"]:
        np.testing.assert_array_equal(samples[name][-1], final[name])
        np.testing.assert_array_equal(samples[name][0], rest[name])
    late = make_simulation(model, rest)
    late.advance(0.0)
    with refused(RuntimeError, "sample times must be set before the run"):
        late.sample([0.0])


def test_samples_without_ledger_or_friction(rest):
    model = make_model(friction=None)
    simulation = make_simulation(model, {**rest, "mu": [], "slip": []}, ledger=False)
    samples = simulation.sample([0.01])
    assert simulation.advance(INF) is True
    assert simulation.state()["mu"].shape == (0,) and simulation.state()["slip"].shape == (0,)
    assert not {"mu", "friction", "slip", "energy"} & samples.keys()
    assert samples["normal"].max() > 0
    with refused(V, "state 'mu' must have shape (0,), got (24,)"):
        make_simulation(model, rest)


@pytest.mark.parametrize(
    ("t", "kind", "message"),
    [
        (0.0, V, r"^t_eval must have shape \(n,\), got \(\)$"),
        ([0.0, math.nan], V, r"^t_eval\[1\] must be finite, got nan$"),
        ([1j], T, "^t_eval must hold real numbers, got dtype complex128$"),
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


def test_chunks_do_not_matter(model, rest, driven):
    simulation = make_simulation(model, rest)
    times = [simulation.time]
    while not simulation.advance(0):
        times.append(simulation.time)
    assert len(times) > 3 and times == sorted(set(times)) and simulation.time == 0.02
    assert same_bits(simulation.state(), driven)
    assert simulation.advance(0) is True and simulation.advance(INF) is True
    for value in [-1.0, math.nan, -INF]:
        with refused(V, f"seconds must be >= 0, got {value!r}"):
            simulation.advance(value)
    simulation = make_simulation(model, rest, t_end=1e5)
    assert simulation.advance(0.02) is False and 0.0 < simulation.time < 1e5


def test_settle_comes_to_rest_or_says_so(model, rest):
    """From the route, or a state; it has no samples."""
    for name in ["vx", "vy", "vphi", "omega"]:
        assert not rest[name].any()
    settling = _core.Simulation.settle(model, rest, tolerance=1e-4)
    with pytest.raises(RuntimeError, match="settling has no samples"):
        settling.sample([0.0])
    assert settling.advance(INF) is True
    np.testing.assert_allclose(settling.state()["x"], rest["x"], atol=1e-5)
    settling = _core.Simulation.settle(model, tolerance=1e-9, max_time=1e-3)
    with pytest.raises(SimulationError, match="did not come to rest") as caught:
        settling.advance(INF)
    assert caught.value.symbol == "BD_ERR_NOT_SETTLED" and caught.value.value > 0


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
        ({"offset": [[0, 0]] * 3}, V, r"^offset must have shape \(2, 2\), got \(3, 2\)$"),
        ({"offset": [[0, 0], [0, math.nan]]}, V, r"^offset\[1, 1\] must be finite, got nan$"),
        ({"tolerance": 0.0}, V, "tolerance must be > 0"),
        ({"max_time": -1.0}, V, "max_time must be finite and >= 0"),
        ({"shift": INF}, V, "shift must be at most the belt's length"),
        ({"model": make_model(centers=[(0, 0), (0.1, 0)])}, V, "overlap"),
    ],
)
def test_settle_refuses(model, options, kind, message):
    with pytest.raises(kind, match=message):
        _core.Simulation.settle(**({"model": model} | options))


SHAPE = "must have shape"
BEGINS = "must be a tuple that begins with its kind, got"


def end_of(model, rest, torque):
    """The state after a run under this torque."""
    simulation = make_simulation(model, rest, torque)
    assert simulation.advance(INF) is True
    return simulation.state()


@pytest.mark.parametrize(
    ("term", "kind", "message"),
    [
        (7, T, f" {BEGINS} 7"),
        ((), T, f" {BEGINS} ()"),
        (["viscous", [0, 0]], T, f" {BEGINS} ['viscous', [0, 0]]"),
        (("spline", [0, 0]), V,
         " must be of kind 'piecewise', 'viscous', 'function', 'call', 'load', 'table', "
         "'harmonics' or 'curve', got 'spline'"),
        (("load", 1, [0, 0]), V, " of kind 'load' must have 3 arguments, got 2"),
        (("load", 2, [0, 0, 0], None), V, "0: pulley must be one of 0 to 1, got 2"),
        (("load", -1, [0, 0, 0], None), V, "0: pulley must be one of 0 to 1, got -1"),
        (("load", 0.0, [0, 0, 0], None), T, " pulley must be an integer, got float"),
        (("load", 0, [0, 0], None), V, f" coefficients {SHAPE} (3,), got (2,)"),
        (("load", 0, [0, -1, 0], None), V, "0: viscous must be finite and >= 0, for it acts "
         "against the rotation; got -1"),
        (("load", 0, [0, 0, 0], [0.0]), T, " factor must be None or (times, factors), got [0.0]"),
        (("load", 0, [0, 0, 0], ([0.0], [1, 2])), V, f" factors {SHAPE} (1,), got (2,)"),
        (("load", 0, [0, 0, 0], ([1.0, 0.0], [1, 2])), V, "0: t must be finite and "
         "non-decreasing, a time given at most twice (a jump); t[1] is 0"),
        (("table", 0, [1.0, 1.0], [0, 0], None), V,
         "0: omega must be finite, >= 0 and increasing; omega[1] is 1"),
        (("table", 0, [1.0], [-3.0], None), V, "0: torque must be finite and >= 0, for it acts "
         "against the rotation; torque[0] is -3"),
        (("table", 0, [], [], None), V, "0: the table must have at least one point"),
        (("table", 0, [1.0], [1.0, 2.0], None), V, f" torques {SHAPE} (1,), got (2,)"),
        (("table", 0, [0.0, INF], [1.0, 2.0], None), V, " speeds[1] must be finite, got inf"),
        (("harmonics", 0, 2, [1], [1], [0], None), V, "0: of must be one of 0 to 1, got 2"),
        (("harmonics", 0, 1, [0], [1], [0], None), V,
         "0: orders must be finite and > 0, orders[0] is 0"),
        (("harmonics", 0, 1, [], [], [], None), V, "0: there must be at least one harmonic"),
        (("harmonics", 0, 1, [1], [1, 2], [0], None), V, f" amplitudes {SHAPE} (1,), got (2,)"),
        (("viscous",), V, " of kind 'viscous' must have 1 argument, got 0"),
        (("call", print, 1), V, " of kind 'call' must have 1 argument, got 2"),
        (("piecewise", [0]), V, " of kind 'piecewise' must have 2 arguments, got 1"),
        (("viscous", [0, 0, 0]), V, f" coefficients {SHAPE} (2,), got (3,)"),
        (("viscous", [0, math.nan]), V, " coefficients[1] must be finite, got nan"),
        (("piecewise", [0, INF], [[0, 0]]), V, " times[1] must be finite, got inf"),
        (("piecewise", [0, 1], [[0, 0]]), V, f" values {SHAPE} (2, 2), got (1, 2)"),
        (("piecewise", [0, 1], [[0, 0], [0, INF]]), V, " values[1, 1] must be finite, got inf"),
        (("call", None), T, " must hold a callable, got NoneType"),
        (("function", 0, 0), V, " function address must not be 0"),
        (("function", -1, 0), V, " function address must be an address, got -1"),
        (("function", 1.0, 0), T, " function address must be an integer, got float"),
        (("function", 1, None), T, " user address must be an integer, got NoneType"),
    ],
)  # fmt: skip
def test_terms_of_torque_refuse(model, rest, term, kind, message):
    """By the binding, "torque[0] ...", or by the core, "torque term 0: ..."."""
    begin = "torque term " if message.startswith("0: ") else "torque[0]"
    with refused(kind, begin + message):
        make_simulation(model, rest, [term])


def test_rules_for_torque_times_and_the_sequence_of_terms(model, rest):
    for t, values, word in (
        ([1, 0], [[0, 0], [0, 0]], "non-decreasing"), ([], np.zeros((0, 2)), "t must not be empty"),
        ([0, 1, 1, 1], np.zeros((4, 2)), r"given at most twice \(a jump\); t\[3\] is 1"),
    ):  # fmt: skip
        with pytest.raises(V, match=word):
            make_simulation(model, rest, [("piecewise", t, values)])
    for torque, kind in ((None, "NoneType"), (7, "int")):
        with refused(T, f"torque must be a sequence of terms, got {kind}"):
            make_simulation(model, rest, torque)


@pytest.mark.parametrize("layout", LAYOUTS)
def test_torques_are_copied_from_any_layout_and_iterable(model, rest, driven, layout):
    (_, t, values), (_, coefficients) = TORQUE
    arrays = [strange_layouts(given)[layout] for given in (t, values, coefficients)]
    torque = [("piecewise", *arrays[:2]), ("viscous", arrays[2])]
    simulation = make_simulation(model, rest, iter(torque))
    for array in arrays:
        if layout not in ("read-only", "list"):
            array[:] = math.nan
    torque.clear()
    assert simulation.advance(INF) is True and same_bits(simulation.state(), driven)
    assert not same_bits(end_of(model, rest, TORQUE[:1]), driven)


def test_compiled_functions(model, rest):
    """Called with the right arguments, user pointer included; the same as the same in Python."""
    numbers = ctypes.POINTER(ctypes.c_double)
    seen = set()

    @ctypes.CFUNCTYPE(None, ctypes.c_double, numbers, numbers, numbers, numbers)
    def compiled(t, theta, omega, torque, user):
        seen.add(user[0])
        torque[0] = -50.0 * t + theta[0]
        torque[1] = -16.0 * omega[1]

    user = ctypes.c_double(42.0)
    address = ctypes.cast(compiled, ctypes.c_void_p).value
    of_compiled = end_of(model, rest, [("function", address, ctypes.addressof(user))])
    assert seen == {42.0}

    def plain(t, theta, omega):
        return [-50.0 * t + theta[0], -16.0 * omega[1]]

    assert same_bits(end_of(model, rest, [("call", plain)]), of_compiled)


def test_terms_add_up(model, rest, driven):
    eight = ("viscous", [0.0, 8.0])
    ramp = ("call", lambda t, theta, omega: [-50.0 * t / 0.02, 0.0])
    final = end_of(model, rest, [eight, ramp, eight])
    np.testing.assert_allclose(final["omega"], driven["omega"], rtol=1e-6)


def test_callables_may_return(model, rest):
    expected = end_of(model, rest, [("piecewise", [0.0], [[-1.0, -2.0]])])
    for answer in [
        [-1.0, -2.0], (-1.0, -2.0), [-1, -2], [np.float64(-1), np.float32(-2)],
        [Fraction(-1), np.array(-2.0)], np.array([-1.0, -2.0]), np.array([-1, -2], "f4"),
        np.array([-1, -2], ">f8"), np.array([-1, -2]), np.array([-1.0, 0.0, -2.0, 0.0])[::2],
        memoryview(np.array([-1.0, -2.0])), range(-1, -3, -1),
    ]:  # fmt: skip
        final = end_of(model, rest, [("call", lambda *_, answer=answer: answer)])
        assert same_bits(final, expected), repr(answer)


MUST = "torque_fn must return 2 torques, one per pulley (answering at t = 0 s)"


class Clearing:
    """A number that takes itself, and the rest, out of the list while that is read."""

    def __float__(self):
        SHRINKING.clear()
        return 1.0


SHRINKING = [Clearing(), 1.0]


@pytest.mark.parametrize(
    ("answer", "kind", "message"),
    [
        (None, T, f"{MUST}, got NoneType"),
        ("12", T, f"{MUST}, got str"),
        (1.0, T, f"{MUST}, got float"),
        (np.array(1.0), T, f"{MUST}, got numpy.ndarray"),
        ({0: 1.0, 1: 2.0}, T, f"{MUST}, got dict"),
        ([1.0], V, f"{MUST}, got 1"),
        ([], V, f"{MUST}, got 0"),
        (np.zeros(3), V, f"{MUST}, got 3"),
        (np.zeros((2, 1)), V, f"{MUST}, got an array of shape (2, 1)"),
        (np.zeros(2, complex), T, f"{MUST}, got an array of dtype complex128"),
        (np.zeros(2, bool), T, f"{MUST}, got an array of dtype bool"),
        (np.array([None, 1.0]), T, f"{MUST}, got an array of dtype object"),
        ([1.0, None], T, f"{MUST}: number 1 must be a real number, got NoneType"),
        ([1j, 1.0], T, f"{MUST}: number 0 must be a real number, got complex"),
        ([1.0, [2.0]], T, f"{MUST}: number 1 must be a real number, got list"),
        ([0.0, Broken()], ZeroDivisionError, "mine"),
        (Broken(), ZeroDivisionError, "mine"),
        (SHRINKING, V, f"{MUST}, got 0"),
    ],
)
def test_callables_must_not_return(model, rest, answer, kind, message):
    def answering(t, theta, omega):
        return answer

    simulation = make_simulation(model, rest, [("call", answering)])
    with refused(kind, message):
        simulation.advance(INF)
    assert simulation.time == 0.0


def test_callables_get_plain_read_only_arrays(model, rest):
    """And may hand them back; one pulley has one torque."""
    state = {**rest, "theta": [0.25, 0.5], "omega": [1.0, 2.0]}
    calls = []

    def torque(t, theta, omega):
        calls.append((t, theta, omega))
        return omega

    final = end_of(model, state, [("call", torque)])
    assert same_bits(final, end_of(model, state, [("call", lambda t, _, omega: omega.tolist())]))
    t, theta, omega = calls[0]
    assert t == 0.0 and type(t) is float
    assert theta.tolist() == [0.25, 0.5] and omega.tolist() == [1.0, 2.0]
    for array in (theta, omega):
        assert type(array) is np.ndarray and array.dtype == np.dtype(float)
        assert array.shape == (2,) and not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    alone = make_model(centers=[(0, 0)], radii=[0.2], inertias=[0.01])
    state = {**rest, "theta": [0.0], "omega": [0.0]}
    with refused(
        ValueError, "torque_fn must return 1 torque, one per pulley (<lambda> at t = 0 s), got 0"
    ):
        end_of(alone, state, [("call", lambda *_: [])])


@pytest.mark.parametrize("value", [math.nan, INF, -INF], ids=["nan", "inf", "-inf"])
def test_torque_that_is_not_finite(model, rest, value):
    def torque(t, theta, omega):
        return [0.0, value if t > 0.01 else 0.0]

    simulation = make_simulation(model, rest, [("call", torque)])
    with pytest.raises(SimulationError, match="torque on pulley 1") as caught:
        simulation.advance(INF)
    error = caught.value
    assert error.symbol == "BD_ERR_TORQUE_VALUE" and error.pulley == 1 and error.body == -1
    assert error.t > 0.01 and error.field == "torque" and error.result is None
    assert repr(error.value) == repr(value)
    assert 0.0 < simulation.time <= 0.01
    with pytest.raises(SimulationError) as again:
        simulation.advance(INF)
    assert str(again.value) == str(error) and again.value is not error
