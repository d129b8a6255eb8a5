"""What guards every run: a case each that once finished with a wrong result and without a word."""

from __future__ import annotations

import ctypes
import math
import re
import sys
import warnings
from typing import Any

import attrs
import drives
import numpy as np
import pytest

import beltdyn as bd

PUSH = bd.PiecewiseLinear([0.0, 0.3], [[0.0, 0.0], [-100.0, 0.0]])
RAMP = PUSH + bd.Viscous([0.0, 15.9])
PLAIN = drives.plain()
METHODS = [method for method in bd.METHODS if method != "auto"]


@pytest.fixture(scope="module")
def rest() -> bd.State:
    return bd.settle(PLAIN)


def codes(result: bd.Result) -> set[str]:
    return {one.code for one in result.warnings} - {"mesh"}


def test_states_that_are_of_no_drive_are_refused(rest: bd.State) -> None:
    """Beside the pulleys; with x and y exchanged; turned, so that the belt hangs together, but runs
    past the second pulley.
    """
    turned = {"x": -rest.y, "y": rest.x, "phi": rest.phi + math.pi / 2}
    for changes, message in (
        ({"x": rest.x + 5.0}, "does not run round pulley 0"),
        ({"x": rest.y, "y": rest.x}, r"joint on the left of link \d+ is stretched"),
        (turned, "does not run round pulley 1"),
    ):
        with pytest.raises(ValueError, match=message):
            bd.simulate(PLAIN, RAMP, 0.1, initial=attrs.evolve(rest, **changes))


def test_settling_that_misses_a_pulley_is_an_error() -> None:
    with pytest.raises(bd.SimulationError, match="no link touches pulley 1") as caught:
        bd.settle(drives.small_idler(0.02, 20))
    assert (caught.value.symbol, caught.value.pulley) == ("BD_ERR_OFF_PULLEY", 1)
    advised = int(re.search(r"n_bodies >= (\d+)", str(caught.value))[1])  # type: ignore[index]
    assert 20 < advised < 1000
    bd.settle(drives.small_idler(0.02, advised))


@pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
def test_joints_that_gape_end_a_run() -> None:
    """Thrown sideways faster than waves run along the belt, whose links then part."""
    with pytest.raises(bd.SimulationError, match="which no belt stretches") as caught:
        bd.scenes.hard["thrown-apart"].run()
    assert caught.value.symbol == "BD_ERR_JOINT_GAP"
    assert caught.value.body >= 0 and caught.value.result is not None


@pytest.mark.parametrize(
    "change",
    [{"contact": {"damping": 1e5}}, {"contact": {"linear": 2.5e11}}, {"friction": {"sigma": 1e8}}],
)
def test_rk4_at_its_own_step(change: dict[str, dict[str, float]]) -> None:
    """It once followed the joints alone: 36 % off, or the belt exploded."""
    ((part, numbers),) = change.items()
    params = attrs.evolve(PLAIN, **{part: attrs.evolve(getattr(PLAIN, part), **numbers)})
    state = bd.settle(params)
    ends = [
        bd.simulate(params, RAMP, 0.02, initial=state, method=method, rtol=1e-6)
        for method in ("rk4", "auto")
    ]
    forces = [end.joints.force[-1] for end in ends]
    # measured: 2e-4 and less, of jumps of friction that no fixed step resolves
    assert np.max(np.abs(forces[0] - forces[1])) <= 2e-3 * np.mean(forces[1])
    assert codes(ends[0]) == set()


def test_rk4_follows_a_viscous_load() -> None:
    light = attrs.evolve(PLAIN, pulleys=[attrs.evolve(p, inertia=1e-5) for p in PLAIN.pulleys])
    run = bd.simulate(light, bd.Viscous([0.0, 100.0]), 1e-4, method="rk4")  # 1e7 1/s
    assert run.stats.largest_step <= 2.8 * 1e-5 / 100.0
    assert np.all(np.abs(run.pulleys.omega) < 1e-3)


@pytest.mark.parametrize("factor", [1.3, 3.0])
def test_an_explicit_step_beyond_stability_ends_the_run(factor: float, rest: bd.State) -> None:
    step = factor * 2.785 / PLAIN.info["spectral_bound"]
    with pytest.raises(bd.SimulationError, match="take a shorter step than") as caught:
        bd.simulate(PLAIN, RAMP, 0.3, initial=rest, method="rk4", step=step)
    assert caught.value.symbol in ("BD_ERR_FIXED_STEP", "BD_ERR_NOT_FINITE", "BD_ERR_BALANCE")


@pytest.mark.parametrize(
    ("method", "rtol", "t_end"),
    [("lbdf2", 0.06, 0.03), ("lbdf2", 0.3, 0.03), ("tsit5", 0.3, 0.0125)],
)
def test_loose_tolerances_keep_what_they_claim(method: str, rtol: float, t_end: float) -> None:
    """A fan run up by a motor, stiff contact: where a step of lbdf2 might err by all that a joint
    is stretched, it lifted all links off the motor, and the next pressed them in with ten times the
    preload's energy; of tsit5, dampers took more than the motor had given. Both runs ended.
    """
    pulleys = [
        bd.Pulley(center=(0.0, 0.0), radius=0.045, inertia=2e-3),
        bd.Pulley(center=(0.35, 0.0), radius=0.09, inertia=2e-2),
    ]
    belt = bd.Belt(n_bodies=100, linear_density=0.1, axial_stiffness=60e3, axial_damping=5.0,
                   bending_stiffness=0.01, preload=400.0)  # fmt: skip
    fan = bd.Params(belt=belt, pulleys=pulleys, friction=bd.Dahl(mu_k=0.8, sigma=1e4))
    torque = bd.PiecewiseLinear([0.0, 0.02], [[0.0, 0.0], [8.0, 0.0]])
    torque = torque + bd.Load(1, quadratic=4e-4)
    run = {"initial": bd.settle(fan), "t_eval": np.linspace(0.0, t_end, 101)}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bd.BeltdynWarning)  # the balance is off by up to 0.2
        exact = bd.simulate(fan, torque, t_end, method="rodas4", rtol=1e-3, **run).joints.force
        loose = bd.simulate(fan, torque, t_end, method=method, rtol=rtol, **run)
    off = np.sqrt(np.mean((loose.joints.force - exact) ** 2)) / exact.mean()
    assert loose.stats.error is not None and off <= loose.stats.error <= 2.0 * rtol


@pytest.mark.parametrize("method", ["lbdf2", "lie"])
def test_a_fixed_implicit_step_that_takes_the_vibration_away_says_so(method: str) -> None:
    """Of the three-pulley scene, 4e-4 s lose 12 % of the energy."""
    params, torque, *_ = bd.scenes.three_pulleys()
    with pytest.warns(bd.AccuracyWarning, match=r"^balance: .* lost by the integration"):
        run = bd.simulate(params, torque, 0.5, method=method, step=4e-4)
    assert "balance" in codes(run)
    assert run.stats.balance < -0.05 and run.stats.error is None


def test_fixed_steps_with_errors_of_the_tension_say_so(rest: bd.State) -> None:
    """Pulleys torn at with 1000 N m: 1.4 times the tension at 1 ms, a quarter at 0.1 ms."""
    torn, errors = bd.PiecewiseLinear([0.0], [[-1000.0, 1000.0]]), []
    for step in (1e-3, 1e-4):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", bd.BeltdynWarning)
            run = bd.simulate(PLAIN, torn, 4e-3, initial=rest, method="lbdf2", step=step)
        errors.append(run.stats.local_error)
        assert ("fixed_step" in codes(run)) == (errors[-1] > 0.5)
    assert 2.0 > errors[0] > 0.5 > errors[1]


def test_the_error_that_fixed_steps_are_warned_of_is_a_bound() -> None:
    """Of "rk4" by a formula of order 3: 0.8 of the tension, where a fortieth is wrong."""
    scene = bd.scenes.hard["torque-step"]
    with pytest.warns(bd.AccuracyWarning, match=r"up to 0\.8.* a formula of lower order") as warned:
        run = scene.run("rk4", step=7.4e-6)
    assert "fixed_step" in codes(run) and warned
    fine = scene.run("rk4", step=2e-6)
    off = np.abs(run.joints.force - fine.joints.force).max() / np.nanmean(fine.span_tension)
    assert off < 0.1 * run.stats.local_error


def warned_of(params: bd.Params, torque: Any, t_end: float, **options: Any) -> set[str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bd.BeltdynWarning)
        return codes(bd.simulate(params, torque, t_end, **options))


def shaken(rest: bd.State, share: float, **others: Any) -> bd.State:
    """Both spans thrown outwards, at a share of the speed of stretch waves."""
    wave = math.sqrt(70e3 / 0.1)
    return attrs.evolve(rest, vy=rest.vy + share * wave * np.sign(rest.y), **others)


def test_vibrations_that_live_for_long_add_errors_up() -> None:
    """Errors of steps add up in a belt without damping that was shaken, which the claim has in it,
    and it is said where it is much; a tenth of the usual damping is enough for neither.
    """
    base = drives.on_mesh(PLAIN, "joint")
    times = np.linspace(0.0, 0.03, 101)
    for damping, rtol, least in ((0.14, 1e-3, 1.0), (0.0, 1e-3, 5.0), (0.0, 1e-5, 20.0)):
        params = attrs.evolve(base, belt=attrs.evolve(base.belt, axial_damping=damping))
        given: dict[str, Any] = {"initial": shaken(bd.settle(params), 0.005), "t_eval": times}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", bd.BeltdynWarning)
            run, exact = (
                bd.simulate(
                    params, bd.Viscous([0, 1]), 0.03, method=method, rtol=tolerance, **given
                )
                for method, tolerance in (("rodas4", rtol), ("tsit5", 0.01 * rtol))
            )
        error = np.sqrt(np.mean((run.joints.force - exact.joints.force) ** 2))
        claim = run.stats.error
        assert claim is not None and error <= 5.0 * claim * np.mean(exact.joints.force)
        assert claim >= 0.9 * least * rtol and (least > 1.0 or claim < 4.0 * rtol)
        assert ("undamped" in codes(run)) == (least >= 20.0)


def test_joints_stretched_by_a_tenth_of_a_link_are_told(rest: bd.State) -> None:
    for share, said in ((0.02, False), (0.1, True)):
        found = warned_of(PLAIN, bd.Viscous([0, 1]), 2e-3, initial=shaken(rest, share))
        assert ("stretch" in found) == said


def test_a_pulley_that_nothing_touches_is_told() -> None:
    """After ten rounds of a wave, 11 ms: links that lay on a larger pulley pass a small one by."""
    start, params = bd.settle(drives.small_idler(0.025, 20)), drives.small_idler(0.02, 20)
    for t_end, said in ((0.009, False), (0.02, True)):
        found = warned_of(params, bd.Viscous([0, 0, 1]), t_end, initial=start)
        assert ("no_contact" in found) == said


def test_what_only_the_first_order_could_do_is_told(rest: bd.State) -> None:
    """A million seconds after zero no step is short enough for 1e-8. A jump or two are left to the
    first order, not a whole run.
    """
    start = shaken(rest, 0.02, t=1e6)
    options: dict[str, Any] = {"initial": start, "method": "lbdf2", "rtol": 1e-8}
    assert "fallback" in warned_of(PLAIN, bd.Viscous([0, 1]), 1e6 + 1e-6, **options)
    with pytest.raises(bd.SimulationError, match="lower limit") as caught:
        bd.simulate(PLAIN, bd.Viscous([0, 1]), 1e6 + 1e-4, **options)
    assert caught.value.result is not None and caught.value.result.stats.fallbacks == 201


def test_the_balance_is_carried_without_a_ledger(rest: bd.State) -> None:
    """The same energies, summed by the trapezoidal rule at the ends of steps."""
    runs = [
        bd.simulate(PLAIN, RAMP, 0.02, initial=rest, ledger=ledger, method=method)
        for ledger in (True, False)
        for method in ("tsit5", "rodas4")
    ]
    assert runs[0].energy is not None and runs[2].energy is None
    for run in runs:
        assert 0.0 < abs(run.stats.balance) < 2e-3
    # what the ledger says at the samples is no more than the worst that was seen
    residual, passed = runs[0].energy.residual, runs[0].energy.passed
    stored = 0.5 * 70e3 * PLAIN.info["strain"] ** 2 * 1.2
    share = np.max(np.abs(residual) / (passed + 0.05 * stored))
    assert share <= 1.1 * abs(runs[0].stats.balance) + 1e-9


def test_times_that_rounding_would_blur_are_refused(rest: bd.State) -> None:
    later = attrs.evolve(rest, t=1.0)
    for options, message in (
        ({"max_step": 1e-17}, "max_step must be at least"),
        ({"method": "lbdf2", "step": 1e-300}, "step must be at least"),
        ({"method": "rk4", "step": 1e-18}, "step must be at least"),
        ({"t_end": 1e300}, "t_end must be within.* sqrt.EA/rho. = 837 m/s"),
        ({"torque_interval": 0.0}, "torque_interval must be > 0"),
        ({"torque_fn": lambda *_: [0, 0], "torque_interval": 1e-12}, "interval must be at least"),
    ):
        given = {"torque_fn": RAMP, "t_end": 1.1, "initial": later, **options}
        with pytest.raises(ValueError, match=message):
            bd.simulate(PLAIN, **given)


def test_a_first_step_of_next_to_nothing_only_delays(rest: bd.State) -> None:
    run = bd.simulate(PLAIN, RAMP, 0.01, initial=rest, method="rodas4", step=1e-300)
    assert run.success and run.stats.steps < 300


@pytest.mark.parametrize(
    ("options", "blamed"),
    [
        ({"max_step": 1e-13}, "max_step = 1e-13 s"),
        ({"method": "lbdf2", "step": 1e-12}, "step = 1e-12 s"),
        (
            {"method": "tsit5", "torque_fn": bd.Viscous([0.0, 1e7])},
            "a load whose torque rises very steeply with its speed",
        ),
        ({"max_step": 1e-13, "max_steps": 45_000}, "limit of 45000 steps"),
    ],
)
def test_a_run_that_gets_nowhere_says_so_early(
    options: dict[str, Any], blamed: str, rest: bd.State
) -> None:
    """Unless a budget of steps is the user's own."""
    turning, own = attrs.evolve(rest, omega=np.array([0.0, 1.0])), options.get("max_steps")
    with pytest.raises(bd.SimulationError, match=blamed) as caught:
        bd.simulate(PLAIN, **{"torque_fn": RAMP, "t_end": 1.0, "initial": turning, **options})
    assert caught.value.symbol == ("BD_ERR_MAX_STEPS" if own else "BD_ERR_STALLED")
    assert own or "no progress at t =" in str(caught.value)
    assert caught.value.result is not None
    assert caught.value.result.stats.steps <= (own or 40_000)


@pytest.mark.filterwarnings("ignore:units")  # a film of water of 6 nm
def test_a_pulley_of_next_to_no_inertia(rest: bd.State) -> None:
    """Explicit steps would take minutes: said within 40 000. Implicit ones do not mind."""
    crank, driven = PLAIN.pulleys
    light = attrs.evolve(PLAIN, pulleys=[crank, attrs.evolve(driven, inertia=1e-9)])
    run = bd.simulate(light, PUSH, 0.05, initial=rest, method="rodas4")
    assert run.stats.steps < 50_000
    with pytest.raises(bd.SimulationError, match="very small inertia") as caught:
        bd.simulate(light, PUSH, 0.3, initial=rest, method="tsit5")
    assert (caught.value.symbol, caught.value.pulley) == ("BD_ERR_STALLED", 1)


def scaled(params: bd.Params, size: float) -> bd.Params:
    """Return a drive of two pulleys with its lengths in a unit ``size`` times as small.

    Masses and times are as they are: a force is ``size`` times as large, a torque its square.
    """

    def part(one: Any, **powers: int) -> Any:
        changes = {name: getattr(one, name) * size**power for name, power in powers.items()}
        return attrs.evolve(one, **changes)

    pulleys = [
        part(attrs.evolve(p, center=(size * p.center[0], size * p.center[1])), radius=1, inertia=2)
        for p in params.pulleys
    ]
    belt = {"length": 1, "linear_density": -1, "axial_stiffness": 1, "axial_damping": 1}
    return attrs.evolve(
        params,
        belt=part(params.belt, **belt, bending_stiffness=3, bending_damping=3),
        pulleys=pulleys,
        contact=part(params.contact, quadratic=-2, linear=-1, damping=-1),
        friction=part(params.friction, sigma=-1),
    )


@pytest.mark.parametrize("method", ["tsit5", "rodas4"])
@pytest.mark.filterwarnings("ignore:units")
def test_a_drive_in_any_unit_of_length(method: str, rest: bd.State) -> None:
    """Lengths times 1e8, masses and times as they are: radii far beyond where the padding of link
    vectors once stood, which explicit methods took for links.
    """
    size = 1e8
    push = bd.PiecewiseLinear(PUSH.t, size**2 * PUSH.values)
    state = attrs.evolve(rest, x=size * rest.x, y=size * rest.y)
    one = bd.simulate(PLAIN, PUSH, 0.02, initial=rest, method=method)
    other = bd.simulate(scaled(PLAIN, size), push, 0.02, initial=state, method=method)
    # forces scale with the length; steps are the same but for rounding, errors are of rtol
    difference = np.max(np.abs(other.joints.force / size - one.joints.force))
    assert difference <= 1e-4 * np.mean(one.joints.force)


def raising(kind: str, error: type[BaseException]) -> Any:
    """A torque function that raises after 10 ms, as itself or by way of its compiled form."""

    def compiled(t, _theta, _omega, torque, _user):  # type: ignore[no-untyped-def]
        if t > 0.01:
            raise error("mine")
        torque[0] = -10.0

    def python(t: float, *_: np.ndarray) -> list[float]:
        torque = [0.0, 0.0]
        compiled(t, None, None, torque, None)
        return torque

    if kind == "ctypes":
        numbers = ctypes.POINTER(ctypes.c_double)
        signature = (ctypes.c_double, numbers, numbers, numbers, ctypes.c_void_p)
        return ctypes.CFUNCTYPE(None, *signature)(compiled)
    if kind == "cffi":
        import cffi

        signature_in_c = "void(double, double *, double *, double *, void *)"
        return cffi.FFI().callback(signature_in_c)(compiled)
    if kind == "numba":
        from numba import cfunc, types

        pointer = types.CPointer(types.double)
        signature_of_types = types.void(types.double, pointer, pointer, pointer, types.voidptr)
        return cfunc(signature_of_types)(compiled)
    return python


@pytest.mark.parametrize("kind", ["python", "ctypes", "cffi", "numba"])
def test_an_exception_comes_with_the_finished_part(kind: str, rest: bd.State) -> None:
    """Of a callback in Python that its compiled form cannot let raise, it was printed, and became
    zero torque and "finished".
    """
    with pytest.raises(ZeroDivisionError, match="mine") as caught:
        bd.simulate(PLAIN, raising(kind, ZeroDivisionError), 0.05, initial=rest)
    part = caught.value.result  # type: ignore[attr-defined]
    assert isinstance(part, bd.Result) and part.status == "failed"
    assert "ZeroDivisionError" in part.message and 0.009 <= part.t[-1] <= 0.01
    if kind in ("ctypes", "cffi"):
        with pytest.raises(bd.Interrupted) as stopped:
            bd.simulate(PLAIN, raising(kind, KeyboardInterrupt), 0.05, initial=rest)
        assert stopped.value.result is not None and stopped.value.result.t[-1] <= 0.01


def test_an_exception_keeps_a_result_of_its_own(rest: bd.State) -> None:
    mine = KeyError("mine")
    mine.result = "mine"  # type: ignore[attr-defined]

    def torque(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
        raise mine

    with pytest.raises(KeyError) as caught:
        bd.simulate(PLAIN, torque, 0.05, initial=rest)
    assert caught.value is mine and mine.result == "mine"  # type: ignore[attr-defined]


def test_other_reports_reach_the_hook_of_before(
    rest: bd.State, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A destructor that fails during a run is none of the run's exceptions. And a hook that
    somebody kept during a run and put back after it does not call itself.
    """
    reports: list[object] = []
    kept: list[Any] = []
    monkeypatch.setattr(sys, "unraisablehook", reports.append)

    class Failing:
        def __del__(self) -> None:
            raise ValueError("in a destructor")

    def torque(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
        kept[:] = [sys.unraisablehook]
        Failing()
        return [0.0, 0.0]

    assert bd.simulate(PLAIN, torque, 1e-3, initial=rest).success
    assert reports and sys.unraisablehook == reports.append
    sys.unraisablehook = kept[0]
    bd.simulate(PLAIN, lambda *_: [0.0, 0.0], 1e-4, initial=rest)
    del reports[:]
    Failing()
    assert len(reports) == 1


@pytest.mark.parametrize("method", METHODS)
def test_a_calm_run_is_not_warned_of(method: str, rest: bd.State) -> None:
    run = bd.simulate(PLAIN, RAMP, 0.1, initial=rest, method=method, rtol=1e-3)
    assert codes(run) == set()
    assert run.stats.growth == 0.0
    # twins: a stretch of at most forty rounds of a wave, of 1.43 ms, at 25 of 70, beyond which
    # none is due; and most end after four
    assert run.stats.twin_steps <= 0.4 * run.stats.steps


@pytest.mark.parametrize("method", ["auto", "tsit5", "rodas4", "lbdf2"])
def test_a_smooth_torque_function_is_no_rough_one(method: str, rest: bd.State) -> None:
    """20 Hz at the samples, in steps longer than the interval at which it is looked at."""

    def torque(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
        return [-60.0 * math.sin(40.0 * math.pi * t), -15.9 * omega[1]]

    rtol = 1e-2 if method == "lbdf2" else 1e-3
    run = bd.simulate(
        PLAIN, torque, 0.1, initial=rest, method=method, rtol=rtol, torque_interval=2e-5
    )
    assert codes(run) == set()
    assert run.stats.error is not None


def test_the_claim_does_not_hang_on_the_ledger() -> None:
    """Without one the balance is summed too coarsely to be part of it."""
    params, torque, *_ = bd.scenes.flywheel_start()
    given: dict[str, Any] = {"initial": bd.settle(params)}
    with pytest.warns(bd.BeltdynWarning, match="^full_slip"):
        one, other = (
            bd.simulate(params, torque, 0.1, ledger=ledger, **given).stats.error
            for ledger in (True, False)
        )
    assert one is not None and other == pytest.approx(one, rel=0.1)


def test_links_that_ring_on_their_contact() -> None:
    """Landing links ring for long at 6 % of critical damping, which wears friction off; long
    implicit steps do not see it, and say so. At 20 % both kinds of method agree to what they ask.
    """
    base = drives.on_mesh(PLAIN, "joint")
    belt = attrs.evolve(base.belt, bending_stiffness=0.0)
    ramp = bd.PiecewiseLinear([0.0, 0.3], [[0.0, 0.0], [-60.0, 0.0]])
    torque, times = ramp + bd.Viscous([0.0, 15.9]), np.linspace(0.3, 0.4, 201)
    critical, off = 2.0 * math.sqrt(2.5e7 * 0.1), {}
    for share in (0.06, 0.2):
        contact = bd.Contact(linear=2.5e7, damping=share * critical)
        params = attrs.evolve(base, belt=belt, contact=contact)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", bd.BeltdynWarning)
            implicit, explicit = (
                bd.simulate(params, torque, 0.4, t_eval=times, method=method, rtol=1e-4)
                for method in ("rodas4", "tsit5")
            )
        spans = [run.span_tension.mean(axis=0) for run in (implicit, explicit)]
        off[share] = float(np.max(np.abs(spans[0] - spans[1])) / np.mean(spans[1]))
        assert ("undamped" in codes(implicit)) == (share < 0.15)
        assert (implicit.stats.error is None) == (share < 0.15)
        assert "undamped" not in codes(explicit)
    assert off[0.06] > 0.01 and off[0.2] < 1e-3


def test_too_long_an_explicit_step_is_a_named_error() -> None:
    with pytest.raises(bd.SimulationError, match=r"has an error of.*shorter step than") as caught:
        bd.simulate(*drives.plain_scene(), method="rk4", step=1e-4)
    error, done = caught.value, caught.value.result
    assert error.symbol == "BD_ERR_FIXED_STEP" and (error.body >= 0 or error.pulley >= 0)
    assert done is not None and done.t[-1] <= error.t < 1.0
    assert np.all(np.isfinite(done.final_state.x)) and np.all(np.isfinite(done.joints.force))


def test_a_belt_that_sinks_into_its_pulleys_rests_with_a_word_or_not_at_all() -> None:
    """490 N of preload leave 490 / (1 + 2 pi 70e3 / (2e3 0.1 1.2)) N, which sink in 1.3 mm, and of
    what the belt's weight adds less than it weighs; 200 times as soft it sinks past half a radius.
    """
    soft = attrs.evolve(drives.plain(), contact=bd.Contact(linear=2e3))
    with pytest.warns(bd.AccuracyWarning, match="^compliance: .* 1.3 % of its radius"):
        rest = bd.settle(soft)
        result = bd.simulate(soft, bd.Viscous([0, 0]), 1e-3, initial=rest)
    weight = 9.81 * soft.belt.linear_density * 1.2
    assert rest.residual <= 1e-8
    assert np.all((result.span_tension > 0.26) & (result.span_tension < 0.27 + weight))
    softer = attrs.evolve(soft, contact=bd.Contact(linear=10.0))
    with (
        pytest.raises(bd.SimulationError, match="the contact is too soft") as failed,
        pytest.warns(bd.AccuracyWarning, match="^compliance: "),
    ):
        bd.simulate(softer, bd.Viscous([0, 0]), 0.1)
    assert failed.value.symbol == "BD_ERR_PASSED_THROUGH"
    assert any("compliance: " in note for note in failed.value.__notes__)


def test_numbers_that_are_not_finite_are_a_named_error(rest: bd.State) -> None:
    """Of 1e160 m/s, whose squares overflow, no step makes anything, however short."""
    mad = attrs.evolve(rest, vx=np.full(rest.vx.size, 1e160))
    with pytest.raises(bd.SimulationError, match="gives finite numbers") as caught:
        bd.simulate(PLAIN, RAMP, 1e-3, initial=mad, method="tsit5")
    assert caught.value.symbol == "BD_ERR_NOT_FINITE"


@pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
def test_steps_of_hardly_any_length_come_to_an_end() -> None:
    """Of a pulley without inertia, from a start after 0: a quarter of one does not move the time,
    and the displaced twin that repeats it must not try such quarters for ever.
    """
    belt = attrs.evolve(PLAIN.belt, n_bodies=20, mesh="paper")
    first = attrs.evolve(PLAIN.pulleys[0], inertia=1e-150)
    light = attrs.evolve(PLAIN, belt=belt, pulleys=[first, PLAIN.pulleys[1]])
    start = attrs.evolve(bd.settle(attrs.evolve(PLAIN, belt=belt)), t=1.5e-4)
    pull = bd.PiecewiseLinear([0.0, 1e-4], [[0.0, 0.0], [-5.0, 0.0]])
    with pytest.raises(bd.SimulationError) as caught:
        bd.simulate(
            light, pull, 2e-3, initial=start, method="rodas4", rtol=5.6e-6, max_steps=60
        )  # fmt: skip
    assert caught.value.symbol == "BD_ERR_MAX_STEPS"


@pytest.mark.filterwarnings("ignore::beltdyn.BeltdynWarning")
def test_belts_thrown_through_a_pulley_are_named_errors() -> None:
    """Links that sink past half of its radius; or that pass it by, which are longer than it."""
    with pytest.raises(bd.SimulationError, match="sank past half the radius of pulley 1") as caught:
        bd.scenes.hard["thrown-through"].run()
    assert caught.value.symbol == "BD_ERR_PASSED_THROUGH" and caught.value.body >= 0
    with pytest.raises(bd.SimulationError, match="no longer runs round pulley 1") as caught:
        bd.scenes.hard["thrown-off"].run()
    assert (caught.value.symbol, caught.value.pulley) == ("BD_ERR_OFF_PULLEY", 1)
