"""Bearing drag (MODEL section 5): closed forms, tangent, balance, steps, what is given.

In a drive without friction a pulley turns free of the belt, so that its speed follows from its drag
alone. That it costs nothing when off: test_off_is_free.py; ledgers and files: test_drive_table.py.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import attrs
import dense
import drives
import numpy as np
import pytest
import scipy.optimize
from bridge import fields
from drives import METHODS
from matplotlib.figure import Figure
from module_common import make_model, refused

import beltdyn as bd

INERTIA = 0.01
START = -60.0  # rad/s


def drive(*drags: bd.Drag | None, friction: bool = True) -> bd.Params:
    """The paper's two pulleys with these drags."""
    base = drives.plain()
    pulleys = [
        bd.Pulley(center=pulley.center, radius=pulley.radius, inertia=INERTIA, drag=drag)
        for pulley, drag in zip(base.pulleys, drags, strict=True)
    ]
    return attrs.evolve(base, pulleys=pulleys, friction=base.friction if friction else None)


def omega_0(params: bd.Params) -> float:
    """As MODEL section 5 states it."""
    belt = params.belt
    wave = math.sqrt(belt.axial_stiffness / belt.linear_density)
    return 1e-3 * params.info["strain"] * wave / 60 / params.pulleys[0].radius


def spin_down(drag: bd.Drag, t_end: float, start: float = START, **options: Any) -> bd.Result:
    """Pulley 0 with drag, pulley 1 without, on a belt at rest that they do not move."""
    params = drive(drag, None, friction=False)
    rest = bd.settle(params)
    turning = attrs.evolve(rest, omega=[start, 7.0])
    result = bd.simulate(
        params, bd.Viscous([0.0, 0.0]), t_end, initial=turning,
        t_eval=np.linspace(0.0, t_end, 41), **options,
    )  # fmt: skip
    assert np.max(np.abs(result.pulleys.omega[:, 1] - 7.0)) <= 1e-12 * 7.0
    return result


pytestmark = pytest.mark.filterwarnings("ignore:(mesh|no_friction):UserWarning")


@pytest.mark.parametrize("method", METHODS)
def test_every_method_follows_its_closed_form(method: str) -> None:
    """w' = -(3 w + 4 w^2), w(0) = 1. Errors of steps, at most the tolerance on the scale of speeds,
    add up at most: drag damps them. A fixed step is that of the joints, far below what drag asks.
    """
    drag = bd.Drag(viscous=3.0 * INERTIA, quadratic=4.0 * INERTIA / 60.0)
    result = spin_down(drag, 0.1, method=method, **METHODS[method])
    gone = np.exp(-3.0 * result.t)
    exact = START * 3.0 * gone / (3.0 + 4.0 * (1.0 - gone))
    allowed = result.stats.steps * METHODS[method].get("rtol", 1e-9) * 1e3 * omega_0(result.params)
    error = np.max(np.abs(result.pulleys.omega[:, 0] - exact))
    assert error <= min(allowed, 0.01 * abs(START))
    implicit = method in ("rodas4", "lbdf2", "lie")
    assert not implicit or result.stats.steps < 600  # its derivative lets steps be long


def test_coulomb_drag_follows_its_closed_form_through_the_stop() -> None:
    """I w' = -C w / sqrt(w^2 + w0^2): sqrt(w^2 + w0^2) - w0 arsinh(w0 / w) falls at C / I.

    While w is large, errors are rounding (as below); in the stop each step's is held to rtol of the
    scale of speeds, and what was before is damped.
    """
    coulomb, rtol = 8.0, 1e-8
    result = spin_down(bd.Drag(coulomb=coulomb), 0.1, method="tsit5", rtol=rtol)
    w0 = omega_0(result.params)

    def fallen(w: float) -> float:
        return math.hypot(w, w0) - w0 * math.asinh(w0 / w)

    for t, omega in zip(result.t, -result.pulleys.omega[:, 0], strict=True):
        level, exact = fallen(-START) - coulomb / INERTIA * t, 0.0
        if level >= fallen(1e-300):
            exact = scipy.optimize.brentq(lambda w, at=level: fallen(w) - at, 1e-300, 100.0)
        assert omega == pytest.approx(exact, abs=10 * rtol * 1e3 * w0, rel=1e-10)
    assert -result.pulleys.omega[-1, 0] < 1e-3 * w0  # it has stopped


@pytest.mark.parametrize("start", [START, -START])
def test_all_terms_together(start: float) -> None:
    """Down to 1 rad/s the sign falls short of 1 by less than w0^2 / 2: w' = -(A + a w + b w^2).
    Steps end at some 1e-5 s, the joints' limit: what else errs is rounding.
    """
    large, damping, square, t_end = 400.0, 8.0, 0.2, 0.0525
    drag = bd.Drag(coulomb=large * INERTIA, viscous=damping * INERTIA, quadratic=square * INERTIA)
    result = spin_down(drag, t_end, start, method="tsit5")
    root = math.sqrt(4.0 * large * square - damping**2)
    angle = math.atan((2.0 * square * 60.0 + damping) / root) - 0.5 * root * result.t
    exact = (root * np.tan(angle) - damping) / (2.0 * square)
    assert exact[-1] > 1.0
    short = large * t_end * 0.5 * omega_0(result.params) ** 2
    error = np.max(np.abs(np.abs(result.pulleys.omega[:, 0]) - exact))
    assert error <= short + 1e-10 * 60.0


def test_below_the_coulomb_torque_a_pulley_creeps() -> None:
    """At w0 M / sqrt(C^2 - M^2), as stated, within the error of a step; it gets there within
    milliseconds, and the stated speed is small: 0.2 mm/s at the rim, however the torque.
    """
    params = drive(bd.Drag(coulomb=2.0), None, friction=False)
    w0, speed = omega_0(params), params.info["drag_speed"]
    assert speed == pytest.approx(w0 * params.pulleys[0].radius, rel=1e-12)
    assert speed < 2e-4
    for share in (0.5, -0.9):
        torque = bd.PiecewiseLinear([0.0], [[share * 2.0, 0.0]])
        result = bd.simulate(params, torque, 0.05, rtol=1e-6)
        creep = w0 * share / math.sqrt(1.0 - share**2)
        assert result.pulleys.omega[-1, 0] == pytest.approx(creep, abs=1e-6 * 1e3 * w0)


def test_tangent_at_every_speed() -> None:
    """Of a pulley free of the belt: its entry of J, exact but for rounding; the slope by central
    differences, over 1e-4 of the scale on which it changes: 1e-8 of curvature.
    """
    drag = bd.Drag(coulomb=2.0, viscous=0.1, quadratic=0.02)
    params = drive(drag, None, friction=False)
    state, w0 = fields(bd.settle(params)), omega_0(params)
    state |= {"mu": np.zeros(0), "slip": np.zeros(0)}
    model = params._model

    def rate(omega: float) -> float:
        at = {**state, "omega": np.array([omega, 0.0])}
        return float(model.rate(at, np.zeros(2))["omega"][0])

    for omega in (0.0, 0.5 * w0, -w0, 3.0 * w0, 1.0, -50.0):
        step = 1e-4 * max(abs(omega), w0)
        by_difference = -(rate(omega + step) - rate(omega - step)) / (2.0 * step)
        w2 = omega**2 + w0**2
        slope = (2.0 * w0**2 / w2**1.5 + 0.1 + 0.04 * abs(omega)) / INERTIA
        # rounding of the torque over the step, where little of it changes
        rounding = 1e-15 * abs(rate(omega)) / step
        assert by_difference == pytest.approx(slope, rel=2e-8, abs=rounding)
        j, names = dense.whole(model, {**state, "omega": np.array([omega, 0.0])})
        own = np.argmax(names == "omega")
        assert j[own, own] == pytest.approx(-slope, rel=1e-12)


def belted(loaded: bool) -> bd.Params:
    """Two light pulleys that stick to 0.3 and 0.1 N m, of bearings unless a load is given."""
    drags = (None, None) if loaded else (bd.Drag(coulomb=0.3), bd.Drag(coulomb=0.1))
    pulleys = [
        bd.Pulley(center=(x, 0.0), radius=radius, inertia=2e-4, drag=drag)
        for x, radius, drag in zip((0.0, 0.3), (0.05, 0.045), drags, strict=True)
    ]
    belt = {"linear_density": 0.1, "axial_stiffness": 5e4, "axial_damping": 2.0}
    belt["bending_stiffness"] = 0.02
    return bd.Params(
        belt=bd.Belt(length=bd.route(pulleys).length / 1.006, n_bodies=24, **belt),
        pulleys=pulleys,
        contact=bd.Contact(linear=2e8, damping=4e3),
        friction=bd.Dahl(mu_k=0.8, sigma=1e4),
    )


#: What breaks a pulley loose, beyond its dry friction, and what holds it.
JUMP, RAMP = bd.Step(0, 0.01, -3.0), bd.Ramp(0, 0.002, 0.006, -4.0)
COULOMB = bd.Load(0, coulomb=0.3) + bd.Load(1, coulomb=0.1)
FALLING = bd.SpeedTable(1, [0.0, 0.5, 1000.0], [2.0, 0.2, 0.2])


@pytest.mark.filterwarnings("ignore:(mesh|long_links):UserWarning")
@pytest.mark.parametrize(
    ("method", "rtol", "torque", "load"),
    [
        ("rodas4", 1e-4, JUMP, None),
        ("rodas4", 1e-4, JUMP, COULOMB),
        ("rodas4", 1e-3, RAMP, FALLING),
        ("lbdf2", 1e-3, RAMP, None),
    ],
)
def test_a_pulley_breaks_loose_when_it_does(
    method: str, rtol: float, torque: bd.Torque, load: bd.Torque | None
) -> None:
    """Within half of the error that the run claims: spans were off by up to 40 claims, for a
    linearised step had the pulley creep on along the slope of its dry friction, unseen by the
    estimate. The reference is explicit, at a tolerance a thousand times finer.
    """
    params = belted(load is not None)
    torque = torque + bd.Viscous([0.0, 0.5]) + (load or bd.Viscous([0.0, 0.0]))
    run = {"initial": bd.settle(params), "t_eval": np.linspace(0.0, 0.02, 101)}
    exact = bd.simulate(params, torque, 0.02, method="tsit5", rtol=1e-3 * rtol, **run).joints.force
    result = bd.simulate(params, torque, 0.02, method=method, rtol=rtol, **run)
    off = np.sqrt(np.mean((result.joints.force - exact) ** 2)) / exact.mean()
    assert result.stats.error is not None
    assert 2.0 * off <= result.stats.error <= 2.0 * rtol


DRAGS = (bd.Drag(coulomb=3.0, viscous=0.1, quadratic=0.02), bd.Drag(viscous=0.3))


@pytest.mark.parametrize("method", METHODS)
def test_the_balance_counts_drag_without_a_ledger(method: str) -> None:
    """Of pulleys that stop by drag alone, left out, 50 J would come from nowhere."""
    params = drive(bd.Drag(coulomb=4.0, viscous=0.2), bd.Drag(coulomb=4.0), friction=False)
    turning = attrs.evolve(bd.settle(params), omega=[-100.0, 30.0])
    result = bd.simulate(
        params, bd.Viscous([0.0, 0.0]), 0.025, initial=turning, ledger=False, method=method,
        **METHODS[method],
    )  # fmt: skip
    assert abs(result.stats.balance) <= 0.02
    assert not any(one.code == "balance" for one in result.warnings)


def test_settling_knows_no_drag() -> None:
    """Free pulleys come to the same rest, to the last bit."""
    kinds = {"friction": True, "pulleys": "free"}
    one, other = (bd.settle(drive(*drags), **kinds) for drags in ((None, None), DRAGS))
    assert all(np.array_equal(fields(one)[name], fields(other)[name]) for name in fields(one))


def test_the_fixed_step_follows_steep_drag() -> None:
    """Decay at 1e6 1/s, of the viscous term or of the Coulomb term near rest: the step of the
    joints, 1e-5 s, would be far beyond the stability limit, 2.8e-6 s.
    """
    w0 = omega_0(drive(None, None))
    plain = spin_down(bd.Drag(viscous=1e-3), 1e-4, method="rk4")
    assert plain.stats.largest_step > 5e-6
    for drag in (bd.Drag(viscous=1e6 * INERTIA), bd.Drag(coulomb=1e6 * INERTIA * w0)):
        steep = spin_down(drag, 1e-4, start=0.3 * w0, method="rk4")
        assert 1e-6 < steep.stats.largest_step < 2.8e-6
        assert abs(steep.pulleys.omega[-1, 0]) < 1e-9 * w0


def test_what_is_no_drag_is_refused() -> None:
    zero = [0.0, 0.0, 0.0]
    for given, kind, message in (
        (1.0, TypeError, "drag must be a sequence of tuples, got float"),
        ([None], ValueError, "drag must have one entry for each of 2 pulleys, got 1"),
        ([zero, None], TypeError, "pulleys[0].drag must be a tuple of 3 numbers, got list"),
        ([(0.0, 0.0), None], ValueError, "pulleys[0].drag must have 3 numbers, got 2"),
    ):
        with refused(kind, message):
            make_model(drag=given)
    with refused(TypeError, "pulley.drag must be a Drag, got float"):
        bd.Pulley(center=(0, 0), radius=0.1, inertia=0.01, drag=0.5)
    text = drive(DRAGS[0], None).to_toml()
    with pytest.raises(ValueError, match=r"^pulleys\[0\]\.drag\.coulomb must be >= 0 "):
        bd.Params.from_toml(text.replace("coulomb = 3.0", "coulomb = -3.0"))
    with pytest.raises(ValueError, match=r"^pulleys\[0\]\.drag\.colomb: unknown field \(did you "):
        bd.Params.from_toml(text.replace("coulomb", "colomb"))


def test_a_drag_is_printed_and_its_loss_is_saved_and_drawn(tmp_path: Path) -> None:
    """Where there is none, there is no column: not in the result, and not in its file."""
    params, start = drive(DRAGS[0], None), bd.settle(drive(None, None))
    for text in ("pulleys[0].drag.coulomb", "3 N m", "pulleys[0].drag.viscous", "0.1 N m s"):
        assert text in str(params)
    assert "pulleys[1].drag" not in str(params) and "drag.coulomb" in str(params.pulleys[0])
    ramp = bd.PiecewiseLinear([0.0, 0.02], [[0.0, 0.0], [-60.0, 0.0]])
    on, off = (bd.simulate(one, ramp, 0.002, initial=start) for one in (params, drive(None, None)))
    energy = on.energy
    parts = energy.joint_loss + energy.contact_loss + energy.friction_loss + energy.drag_loss
    assert np.array_equal(energy.losses, parts) and (np.diff(energy.drag_loss) >= 0.0).all()
    ax = bd.plot.energy(on, ax=Figure().add_subplot())
    assert "bearing drag" in [text.get_text() for text in ax.get_legend().get_texts()]
    on.save(tmp_path / "on.npz")
    off.save(tmp_path / "off.npz")
    assert bd.Result.load(tmp_path / "off.npz").energy.drag_loss is None
    with np.load(tmp_path / "on.npz") as one, np.load(tmp_path / "off.npz") as other:
        column = {"energy.drag_loss": one["energy.drag_loss"]}
        lacking, more = {k: v for k, v in one.items() if k not in column}, {**other, **column}
    for arrays, message in ((lacking, "is missing"), (more, "does not belong there")):
        np.savez(tmp_path / "bad.npz", **arrays)
        with pytest.raises(ValueError, match=rf"energy\.drag_loss {message}"):
            bd.Result.load(tmp_path / "bad.npz")
