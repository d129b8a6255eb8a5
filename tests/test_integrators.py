"""Steps: order on a smooth scene, error against tolerance, stops, samples, limits, failure."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from smooth import T_END, observed_order, smooth_scene, swing

import beltdyn as bd

SOLVERS = Path(__file__).parent.parent / "csrc" / "solvers"
EXPLICIT = [path for path in sorted(SOLVERS.glob("*.c")) if "BD_EXPLICIT(" in path.read_text()]

Tree = tuple[Any, ...]
"""A rooted tree, as those hanging from its root."""


def trees(order: int) -> set[Tree]:
    """All rooted trees of so many nodes: each that is smaller by one, a leaf put on any node."""

    def grown(tree: Tree) -> Iterator[Tree]:
        yield (*tree, ())
        for k, branch in enumerate(tree):
            for more in grown(branch):
                yield (*tree[:k], more, *tree[k + 1 :])

    def sorted_tree(tree: Tree) -> Tree:
        return tuple(sorted(sorted_tree(branch) for branch in tree))

    if order == 1:
        return {()}
    return {sorted_tree(more) for tree in trees(order - 1) for more in grown(tree)}


def size_and_density(tree: Tree) -> tuple[int, int]:
    parts = [size_and_density(branch) for branch in tree]
    size = 1 + sum(part[0] for part in parts)
    return size, size * math.prod(part[1] for part in parts)


def weight_of_stages(tree: Tree, a: np.ndarray) -> np.ndarray:
    products = [a @ weight_of_stages(branch, a) for branch in tree]
    return np.prod([np.ones(len(a)), *products], axis=0)


@pytest.mark.parametrize("path", EXPLICIT, ids=lambda path: path.stem)
def test_explicit_methods_meet_their_order_conditions(path: Path) -> None:
    """Butcher's, b phi(tree) = 1 / gamma(tree): of the order that the file states, and of one less
    than its errors' for the formula that it is compared with.

    Coefficients are printed to 16 digits and of size 13 at most; the products are of two of them.
    """
    text = path.read_text()

    def numbers(name: str) -> np.ndarray:
        found = re.search(rf"double {name}\[\] = \{{(.*?)\}}", text, re.DOTALL)
        assert found, name
        quotients = [number.split("/") for number in found[1].split(",") if number.strip()]
        return np.array([float(top) / float(*below or [1]) for top, *below in quotients])

    def number(name: str) -> int:
        found = re.search(rf"\.{name} = (\d+)", text)
        assert found, name
        return int(found[1])

    c, error, stages = numbers("c"), numbers("error"), number("stages")
    a = np.zeros((stages, stages))
    a[np.tril_indices(stages, -1)] = numbers("a")
    assert len(c) == len(error) == stages
    assert number("vectors") == stages
    np.testing.assert_allclose(a.sum(axis=1), c, rtol=0, atol=1e-13)
    assert c[-1] == 1.0
    b = a[-1]
    for weights, order in ((b, number("order")), (b - error, number("error_order") - 1)):
        for tree in {tree for n in range(1, order + 1) for tree in trees(n)}:
            exact = 1 / size_and_density(tree)[1]
            assert weights @ weight_of_stages(tree, a) == pytest.approx(exact, abs=1e-13), tree
    assert max(abs(error)) > 1e-3


def test_trees_are_all_there() -> None:
    assert [len(trees(order)) for order in range(1, 6)] == [1, 1, 2, 4, 9]


def final(params: bd.Params, start: bd.State, t_end: float, **options: object) -> np.ndarray:
    end = bd.simulate(params, swing, t_end, initial=start, t_eval=[t_end], **options).final_state
    return np.concatenate([end.x, end.y, end.phi, end.vx / 100, end.vy / 100, end.theta])


def test_orders_on_a_smooth_scene() -> None:
    """Classical Runge-Kutta: 4. Tsit5 with its step held by max_step: 5."""
    params, start = smooth_scene()
    t_end = T_END
    bound = params.info["spectral_bound"]
    exact = final(params, start, t_end, method="rk4", step=0.02 / bound)
    # friction and contact never kink in this window
    probe = bd.simulate(params, swing, t_end, initial=start)
    assert np.array_equal(probe.contact.pulley[0], probe.contact.pulley[-1])

    for method, order, counts in (
        ("rk4", 4.0, (60, 80, 110, 150)),
        ("tsit5", 5.0, (40, 50, 60, 75)),
    ):
        steps = [t_end / n for n in counts]
        assert steps[0] * bound < 3.2
        held = [{"step": h} if method == "rk4" else {"step": h, "max_step": h, "rtol": 1.0}
                for h in steps]  # fmt: skip
        errors = [np.max(np.abs(final(params, start, t_end, method=method, **o) - exact))
                  for o in held]  # fmt: skip
        # steps near the stability limit are not quite asymptotic; from above is no fault
        assert order - 0.35 <= observed_order(steps, errors) <= order + 1.0, method


def test_dense_output_keeps_the_order() -> None:
    """Samples inside long steps: error of order 4 (rk4's Hermite cubic, Tsit5's interpolant: 4-5).

    Against the same run with steps so short that interpolation plays no part.
    """
    params, start = smooth_scene()
    t_end = T_END
    times = np.sort(np.random.default_rng(2).uniform(0, t_end, 200))
    bound = params.info["spectral_bound"]
    kwargs = {"initial": start, "t_eval": times}
    exact = bd.simulate(params, swing, t_end, method="rk4", step=0.02 / bound, **kwargs)
    for method, counts in (("rk4", (60, 80, 110, 150)), ("tsit5", (40, 50, 60, 75))):
        steps = [t_end / n for n in counts]
        errors = []
        for h in steps:
            options = {"step": h} if method == "rk4" else {"step": h, "max_step": h, "rtol": 1.0}
            got = bd.simulate(params, swing, t_end, method=method, **kwargs, **options)
            errors.append(np.max(np.abs(got.belt.x - exact.belt.x)))
        assert observed_order(steps, errors) >= 3.6, method


def test_error_follows_the_tolerance() -> None:
    """Asked and got, case 1 through contact and friction kinks: forces against a tight run.

    The tolerance bounds each step's error on the stretch scale. Over this window errors add up,
    and force errors are stretch errors over stretch, so error <= 10 rtol is the least to ask; the
    stability limit makes loose tolerances better than asked.
    """
    scene = bd.scenes.three_pulleys()
    start = bd.simulate(*scene[:2], 0.2, t_eval=[0.2]).final_state
    times = 0.2 + np.sort(np.random.default_rng(4).uniform(0, 0.02, 100))
    kwargs = {"initial": start, "t_eval": times}
    exact = bd.simulate(*scene[:2], 0.22, rtol=1e-10, max_step=1e-6, **kwargs).joints.force
    tension = np.mean(exact)
    ladder = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6]
    errors = []
    for rtol in ladder:
        force = bd.simulate(*scene[:2], 0.22, rtol=rtol, **kwargs).joints.force
        errors.append(np.sqrt(np.mean((force - exact) ** 2)) / tension)
    assert all(error <= 10 * rtol for error, rtol in zip(errors, ladder, strict=True))
    assert errors[-1] < 0.1 * errors[0]


def test_methods_agree() -> None:
    scene = bd.scenes.unequal_pulleys()
    start = bd.simulate(*scene[:2], 0.06, t_eval=[0.06]).final_state
    kwargs = {"initial": start, "t_eval": np.linspace(0.06, 0.07, 11)}
    tsit5 = bd.simulate(*scene[:2], 0.07, method="tsit5", rtol=1e-7, **kwargs)
    rk4 = bd.simulate(*scene[:2], 0.07, method="rk4", step=1e-6, **kwargs)
    rodas4 = bd.simulate(*scene[:2], 0.07, method="rodas4", rtol=1e-7, **kwargs)
    tension = np.mean(tsit5.joints.force)
    # rk4 at 1/7 of its limit straddles kinks with order 1: 1e-6 s of a step's share in them
    assert np.max(np.abs(tsit5.joints.force - rk4.joints.force)) <= 1e-5 * tension
    assert np.max(np.abs(tsit5.joints.force - rodas4.joints.force)) <= 1e-5 * tension
    assert rk4.stats.rejected == 0
    assert rk4.stats.nfev == pytest.approx(4 * rk4.stats.steps, rel=1e-3)
    assert tsit5.stats.nfev == pytest.approx(
        6 * (tsit5.stats.steps + tsit5.stats.rejected), rel=0.02
    )


def test_steps_end_on_breakpoints_and_never_on_samples() -> None:
    params = drives.plain()
    start = bd.settle(params)
    seen: list[float] = []

    def torque(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
        seen.append(t)
        return [-5.0 if t >= 1.2345e-3 else 0.0, 0.0]

    times = np.linspace(0, 3e-3, 1000)
    many = bd.simulate(params, torque, 3e-3, initial=start, t_eval=times, breakpoints=[1.2345e-3])
    # on the very time, seen from either side
    assert np.nextafter(1.2345e-3, 0) in seen
    assert np.nextafter(1.2345e-3, 1) in seen
    assert not any(a < 1.2345e-3 < b for a, b in pairwise(seen) if b - a < 0)
    assert 3e-3 in seen
    few = bd.simulate(params, torque, 3e-3, initial=start, t_eval=[3e-3], breakpoints=[1.2345e-3])
    assert many.stats.steps == few.stats.steps
    assert np.array_equal(many.final_state.x, few.final_state.x)


@pytest.mark.parametrize("included", [True, False], ids=["t >= tb", "t > tb"])
def test_a_named_jump_of_a_function_has_two_sides(included: bool) -> None:
    """However the function itself decides at the jump: the same as the object that knows it."""
    params = drives.plain()
    start = bd.settle(params)
    at = 2.0001e-3

    def torque(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
        return [-1000.0 * (t >= at if included else t > at), 0.0]

    known = bd.PiecewiseLinear([at, at], [[0, 0], [-1000, 0]])
    kwargs = {"initial": start, "t_eval": np.linspace(0, 3e-3, 31), "rtol": 1e-2}
    one = bd.simulate(params, known, 3e-3, **kwargs)
    other = bd.simulate(params, torque, 3e-3, breakpoints=[at], **kwargs)
    assert np.array_equal(one.pulleys.omega, other.pulleys.omega)
    assert one.stats.steps == other.stats.steps


def test_free_pulley_follows_the_closed_form() -> None:
    """A pulley under a ramp, friction off: omega = slope t^2 / 2 I, theta = slope t^3 / 6 I."""
    base = drives.plain()
    params = attrs.evolve(base, friction=None)
    ramp = bd.PiecewiseLinear([0.0, 1.0], [[0, 0], [-3.0, 0.0]])
    with pytest.warns(bd.BeltdynWarning, match="^no_friction: pulley 0 is driven"):
        result = bd.simulate(params, ramp, 0.05, t_eval=np.linspace(0, 0.05, 51), method="tsit5")
    t = result.t
    # polynomials of degree 3: exact for both the method and its dense output, but for rounding
    assert result.pulleys.omega[:, 0] == pytest.approx(-3.0 * t**2 / 2 / 0.01, rel=1e-11, abs=1e-15)
    assert result.pulleys.theta[:, 0] == pytest.approx(-3.0 * t**3 / 6 / 0.01, rel=1e-11, abs=1e-15)
    assert not result.pulleys.theta[:, 1].any()


def test_viscous_spin_down_follows_the_closed_form() -> None:
    params = attrs.evolve(drives.plain(), friction=None)
    start = attrs.evolve(bd.settle(params), omega=np.array([3.0, -2.0]))
    result = bd.simulate(params, bd.Viscous([0.1, 0.3]), 0.1, initial=start, method="tsit5")
    exact = np.array([3.0, -2.0]) * np.exp(-result.t[:, None] * np.array([0.1, 0.3]) / 0.01)
    assert np.max(np.abs(result.pulleys.omega - exact)) <= 1e-10


def test_links_in_contact_are_found_without_testing_the_rest() -> None:
    """The list of links near a pulley is rebuilt once per some millimetres of travel, and hides
    nothing: contact forces are those of all pairs (compared with the oracle in test_oracle).
    """
    scene = drives.plain_scene()
    result = bd.simulate(*scene)
    travelled = abs(result.pulleys.theta[-1]).max() * 0.1
    spacing = scene.params.info["link_length"]
    assert 2 <= result.stats.searches <= 2 + 8 * travelled / spacing
    assert result.stats.searches < 1e-2 * result.stats.steps


def test_effects_name_what_was_simulated_and_no_more() -> None:
    scene = drives.plain_scene()
    bare = attrs.evolve(
        scene.params, friction=None, belt=attrs.evolve(scene.params.belt, bending_stiffness=0.0)
    )
    full = bd.simulate(*bd.scenes.three_pulleys()[:2], 1e-4).effects
    with pytest.warns(bd.BeltdynWarning, match="^no_friction: "):
        none = bd.simulate(bare, scene.torque_fn, 1e-4, ledger=False).effects
    text = " | ".join(full)
    for word in ("bending", "gravity", "Dahl", "ledger"):
        assert word in text
        assert word not in " | ".join(none)


def test_step_floor_is_a_named_error() -> None:
    """A torque that flickers faster than any step can follow; the later, the sooner rounding of t
    ends it.
    """
    params = drives.plain()
    start = attrs.evolve(bd.settle(params), t=1e3)
    flips = [0]

    def flicker(t: float, theta: np.ndarray, omega: np.ndarray) -> list[float]:
        flips[0] += 1
        return [1e13 * (-1) ** flips[0], 0.0]

    with pytest.raises(bd.SimulationError, match=r"lower limit.*breakpoints") as caught:
        bd.simulate(params, flicker, 1e3 + 1e-3, initial=start)
    error = caught.value
    assert error.symbol == "BD_ERR_STEP_FLOOR"
    assert error.pulley == 0
    assert error.field == "omega"
    assert error.result is not None
    assert not error.result.success


def test_too_long_a_fixed_step_is_a_named_error() -> None:
    scene = drives.plain_scene()
    with pytest.raises(bd.SimulationError, match=r"has an error of.*shorter step than") as caught:
        bd.simulate(*scene, method="rk4", step=1e-4)
    error = caught.value
    assert error.symbol == "BD_ERR_FIXED_STEP"
    assert 0.0 <= error.t < 1.0
    assert error.body >= 0 or error.pulley >= 0
    done = error.result
    assert done.t[-1] <= error.t
    assert np.all(np.isfinite(done.final_state.x))
    assert np.all(np.isfinite(done.joints.force))


def test_limit_on_steps_is_a_named_error() -> None:
    scene = drives.plain_scene()
    with pytest.raises(bd.SimulationError, match="limit of 100 steps") as caught:
        bd.simulate(*scene, max_steps=100)
    assert caught.value.symbol == "BD_ERR_MAX_STEPS"
    assert caught.value.result.stats.steps == 100


def test_belt_pulled_through_a_pulley_is_a_named_error() -> None:
    base = drives.plain()
    # 490 N of preload are left with 490 / (1 + 2 pi 70e3 / (2e4 0.1 1.2)) N, which sink in 1.3 mm.
    params = attrs.evolve(base, contact=bd.Contact(linear=2e4))
    with (
        pytest.raises(bd.SimulationError, match="pulley") as failed,
        pytest.warns(bd.AccuracyWarning, match="^compliance: .* 1.3 % of its radius"),
    ):
        bd.simulate(params, bd.Viscous([0, 0]), 0.1)
    assert any("compliance: " in note for note in failed.value.__notes__)
