"""Every method with its default settings against reference curves of the paper's cases.

The curves were made by two integrators that share nothing (`reference_curves.py`); their difference
is the floor below which nothing can be told.
"""

from __future__ import annotations

import inspect
import math
import shlex
from collections.abc import Collection
from itertools import cycle, product
from typing import Any

import attrs
import numpy as np
import pytest
import reference_curves as rc
import stored_runs
from tiers import ci_if

import beltdyn as bd
from beltdyn.base.run_options import METHODS

#: Every method once, on some of the legs, by default; all legs of all cases in CI.
SOME = (0, 4, 7)
DEALT = [(case, method, SOME) for case, method in zip(cycle(rc.CASES), METHODS, strict=False)]
WHOLE = [(case, method, range(rc.LEGS)) for case, method in product(rc.CASES, METHODS)]
DEFAULT_RTOL = float(inspect.signature(bd.simulate).parameters["rtol"].default)


def remake(case: str) -> str:
    return f"make it anew: python tests/reference_curves.py --case {shlex.quote(case)}"


def load(case: str) -> tuple[bd.Scene, rc.Curves]:
    """Return the scene and its curves; fails if they are not of this scene."""
    scene, path = rc.CASES[case](), rc.path_of(case)
    if not path.exists():
        pytest.fail(f"tests/curves/{path.name} is missing; {remake(case)}")
    curves = rc.Curves.read(path)
    try:
        same = bd.Scene.from_toml(curves.scene) == scene
    except ValueError as error:
        pytest.fail(f"tests/curves/{path.name} holds a scene of old ({error}); {remake(case)}")
    if not same:
        pytest.fail(f"tests/curves/{path.name} is of a scene that has changed; {remake(case)}")
    if curves.oracle != stored_runs.hash_of_oracle():
        pytest.fail(f"tests/curves/{path.name} is of an oracle that has changed; {remake(case)}")
    return scene, curves


def allowed(scene: bd.Scene, curves: rc.Curves, force: float) -> dict[str, float]:
    """Errors that go with an error ``force`` of the joint forces over the mean tension.

    A contact force balances the joint forces beside it. Both spans pull at a pulley, which swings
    against the other on them: their torque error 2 force T r turns into speed over I Omega, Omega
    the frequency of two equal pulleys on two spans of stiffness EA / span each. A span that is too
    long by force times its stretch shifts links on the pulley by that much, mu by sigma of it.
    """
    params = scene.params
    pulleys = params.pulleys
    belt, pulley = params.belt, min(pulleys, key=lambda p: p.inertia)
    span = math.dist(pulleys[0].center, pulleys[1].center)
    swing = math.sqrt(4.0 * belt.axial_stiffness / span * pulley.radius**2 / pulley.inertia)
    speed = 2.0 * curves.tension * pulley.radius / (pulley.inertia * swing)
    stretch = curves.tension / belt.axial_stiffness * span
    assert params.friction is not None
    return {
        "omega": force * speed / curves.scales()["omega"],
        "force": force,
        "mu": force * params.friction.sigma * stretch,
        "normal": force,
    }


def fixed_step(scene: bd.Scene, curves: rc.Curves, error: float) -> float:
    """Step with which a fixed-step method errs by no more than ``error``, over the mean tension.

    It does not see a link touch a pulley within a step: the contact damper's jump b v acts for up
    to a step too long or short, v = omega l0 / 2, and stretches b v h / (m w), w^2 = 2 c / m.
    Each of two pulleys may do so at once. Never beyond 3/4 of the stability limit 2.785.
    """
    info = scene.params.info
    contact_jump = (
        info["contact_damping"] * 0.5 * curves.scales()["omega"] * info["link_length"]
    )  # N
    mode = math.sqrt(2.0 * info["joint_stiffness"] * info["link_mass"])  # m w
    stretch = curves.tension / info["joint_stiffness"]
    return min(0.5 * error * stretch * mode / contact_jump, 0.75 * 2.785 / info["spectral_bound"])


@pytest.mark.parametrize("case", rc.CASES)
def test_curves_are_of_the_scene(case: str) -> None:
    """Its parameters and torques, its whole run, and the start that a run takes by itself.

    Settling ends at 1e-9 of the tension out of balance; along its path the belt is all but free,
    so that much force may be a thousand times more of place (forces: 1e-6).
    """
    scene, curves = load(case)
    assert (curves.edges[0], curves.edges[-1]) == (0.0, scene.t_end)
    assert all(samples.stop - samples.start > 20 for _, samples in curves.legs())
    own = bd.simulate(*scene[:2], 1e-6, t_eval=[0.0])
    kept = bd.simulate(*scene[:2], 1e-6, t_eval=[0.0], initial=curves.state(0))
    change = np.max(np.abs(own.joints.force - kept.joints.force)) / curves.tension
    assert change <= 1e-6, f"the start of the scene has changed by {change:.1g}; {remake(case)}"


@pytest.mark.parametrize("case", rc.CASES)
def test_floor(case: str) -> None:
    """In every leg the two integrators agree as well as the oracle's tests promise for 0.05 s:
    1e-6 of the mean tension (and of the speed), 1e-5 in mu; and they are two.

    Over the whole run the floors of the legs add up, each grown by the legs after it: by no more
    than LEGS times the worst floor times the product of the growths so far. Where nothing grows
    that is a bound; where much does, it says that the curves are known leg by leg only.
    """
    _, curves = load(case)
    most = {"omega": 1e-6, "force": 1e-6, "mu": 1e-5, "normal": 1e-6}
    for leg, samples in curves.legs():
        for name, (worst, _) in curves.floor(samples).items():
            assert worst <= most[name], (leg, name)
        assert curves.floor(samples)["force"][1] > 0.0
    grown = np.cumprod(np.maximum(curves.growth, 1.0))
    bound = rc.LEGS * grown[:, None] * np.array([most[name] for name in rc.QUANTITIES])
    assert np.all(curves.run_floor <= bound)


def legs_by_defaults(
    scene: bd.Scene,
    curves: rc.Curves,
    bounds: dict[str, float],
    legs: Collection[int],
    **options: Any,
) -> dict[str, rc.Array]:
    """Errors of a method over what a leg allows: the bound times its growth, plus its floor."""
    shares: dict[str, list[rc.Array]] = {name: [] for name in bounds}
    for leg, samples in curves.legs():
        if leg not in legs:
            continue
        result = bd.simulate(
            *scene[:2],
            curves.edges[leg + 1],
            t_eval=curves.t[samples],
            initial=curves.state(leg),
            **options,
        )
        floor = curves.floor(samples)
        for name, error in curves.errors(rc.pick(result, curves.links), samples).items():
            share = np.abs(error) / (max(1.0, curves.growth[leg]) * bounds[name] + floor[name][0])
            shares[name].append(share)
    return {name: np.vstack(parts) for name, parts in shares.items()}


@pytest.mark.one_in(2)
@pytest.mark.filterwarnings("ignore:balance")  # Euler's method damps, and says so
@pytest.mark.parametrize(
    ("case", "method", "legs"), ci_if(lambda row: row[2] is not SOME, [*DEALT, *WHOLE])
)
def test_defaults_against_the_curves(case: str, method: str, legs: Collection[int]) -> None:
    """From A's states at the start of each leg: joint forces to what the default tolerance allows.

    The tolerance bounds the error of one step in a joint's stretch, which over the mean stretch is
    that of its force over the mean tension. Only steps that straddle a kink come near it, and ring
    down before many more are added: ten of them at the worst sample, one in the mean. The method of
    order 1 damps what moves slowly as well: its errors add up, and it is allowed twenty times as
    much. What the drive makes of an error, the growth of the leg, comes on top.
    """
    scene, curves = load(case)
    force = (200.0 if method == "lie" else 10.0) * DEFAULT_RTOL
    options: dict[str, Any] = {"method": method}
    if method == "rk4":
        options["step"] = fixed_step(scene, curves, force)
    shares = legs_by_defaults(scene, curves, allowed(scene, curves, force), legs, **options)
    for name, share in shares.items():
        worst, mean = np.max(share), np.sqrt(np.mean(share**2))
        print(f"  case {case}, {method}, {name}: max {worst:.1e}, rms {mean:.1e} of what may be")
        assert worst <= 1.0, name
        assert mean <= 0.1, name


def test_a_drive_slightly_off_is_told_apart() -> None:
    """A belt softer by 1 % pulls by 1 % less from the same places, ten times the bound."""
    scene, curves = load("1")
    params = scene.params
    belt = attrs.evolve(params.belt, axial_stiffness=0.99 * params.belt.axial_stiffness)
    other = scene._replace(params=attrs.evolve(params, belt=belt))
    shares = legs_by_defaults(other, curves, allowed(scene, curves, 10.0 * DEFAULT_RTOL), (4,))
    assert np.max(shares["force"]) > 1.0
    assert np.sqrt(np.mean(shares["force"] ** 2)) > 0.1


def test_files_are_small() -> None:
    size = sum(path.stat().st_size for path in rc.DIRECTORY.glob("*.npz"))
    assert size < 300_000
    assert {path.name for path in rc.DIRECTORY.glob("*.npz")} == {
        rc.path_of(case).name for case in rc.CASES
    }


def test_stale_files_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    changed = rc.CASES["1"]()
    belt = attrs.evolve(changed.params.belt, linear_density=0.11)
    changed = changed._replace(params=attrs.evolve(changed.params, belt=belt))
    for owner, name, value, what in (
        (stored_runs, "hash_of_oracle", lambda: "another", "an oracle"),
        (rc, "CASES", {"1": lambda: changed}, "a scene"),
    ):
        monkeypatch.setattr(owner, name, value)
        message = rf"is of {what} that has changed; .*reference_curves\.py --case 1"
        with pytest.raises(pytest.fail.Exception, match=message):
            load("1")
