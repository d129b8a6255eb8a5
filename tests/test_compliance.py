"""How far the belt sinks into its pulleys, against runs: depth, tension, ratio, errors; compensated
and chosen contacts. All on the mesh of joints, whose own errors are small.
"""

from __future__ import annotations

import functools
import math
from typing import Any

import attrs
import drives
import numpy as np
import pytest
from tiers import first

import beltdyn as bd
from beltdyn.drive import compliance

#: Contacts that are soft on purpose are warned of.
pytestmark = pytest.mark.filterwarnings("ignore:compliance:beltdyn.AccuracyWarning")

EA, STRAIN, DISTANCE = 70e3, 0.007, 0.29
SOFT = bd.Contact(linear=2.5e7, damping=1.5e3)
CONTACTS = {
    "soft": SOFT,
    "softer": bd.Contact(linear=5e6, damping=1e3),
    "quadratic": bd.Contact(quadratic=1e11, linear=1e7, damping=1e3),
    "stiff": bd.Contact(linear=2.5e9, damping=1.5e4),
}


def drive(
    contact: bd.Contact | None = None,
    radii: tuple[float, float] = (0.06, 0.12),
    n_bodies: int = 120,
    **belt: Any,
) -> bd.Params:
    pulleys = [
        bd.Pulley(center=(0.0, 0.0), radius=radii[0], inertia=0.005),
        bd.Pulley(center=(DISTANCE, 0.0), radius=radii[1], inertia=0.02),
    ]
    data = {"length": bd.route(pulleys).length / (1.0 + STRAIN), "n_bodies": n_bodies,
            "linear_density": 0.1, "axial_stiffness": EA, "axial_damping": 1.4, "mesh": "joint",
            "model": "links"}  # fmt: skip  # at_rest reads the belt off their angles
    return bd.Params(
        belt=bd.Belt(**(data | belt)),
        pulleys=pulleys,
        contact=contact or bd.Contact(),
        friction=bd.Dahl(mu_k=0.8, sigma=1e4),
    )


def at_rest(params: bd.Params) -> tuple[float, np.ndarray]:
    """Mean tension of a settled belt, and how far it lies inside each radius [m]."""
    state, l0 = bd.settle(params), params.info["link_length"]
    centre = np.column_stack([state.x, state.y])
    half = 0.5 * l0 * np.column_stack([np.cos(state.phi), np.sin(state.phi)])
    left, right = centre - half, np.roll(centre + half, 1, axis=0)
    stretch = np.linalg.norm(left - right, axis=1)
    joint, inside = 0.5 * (left + right), []
    for k, pulley in enumerate(params.pulleys):
        away = joint - pulley.center
        # The middle of the wrap: to the left of the left pulley, to the right of the right one.
        middle = away[:, 0] * (2 * k - 1) > 0.7 * pulley.radius
        angle = 0.5 * l0 / pulley.radius
        circle = pulley.radius * angle / math.sin(angle)
        inside.append(circle - float(np.hypot(*away[middle].T).mean()))
    return float(params.info["joint_stiffness"] * stretch.mean()), np.array(inside)


def shares(params: bd.Params) -> np.ndarray:
    return np.asarray(params.compliance.relative_depth[:, 0])


def second_order(params: bd.Params) -> float:
    """What the closed form leaves out of the change of tension, relative to the depth's effect.

    p/R from the pressure on R - p, from the arc of R - p and from that of the other pulley, of
    order one each. And where the belt meets a pulley it sinks in over a length of sqrt(T/c') = R
    sqrt(p/R), not at once: in that zone a string on an elastic foundation is longer by 5/12 p
    sqrt(p/R) than on the smaller circle, at each end of a wrap.
    """
    share = float(shares(params).max())
    wrap = float(np.min(params.route.wraps))
    return 3.0 * share + 2.0 * 5.0 / 12.0 * math.sqrt(share) / wrap


def mesh_tension(params: bd.Params) -> float:
    """Tension that the mesh may add [N]: at each end of a wrap a link lies on it in part, which is
    worth the difference of its chord and its arc, l0^3 / (24 R^2), at most.
    """
    l0 = params.info["link_length"]
    longer = sum(2.0 * l0**3 / (24.0 * pulley.radius**2) for pulley in params.pulleys)
    return float(EA * longer / params.belt.length)


@pytest.mark.parametrize("name", CONTACTS)
def test_depth_and_tension_at_rest_against_settled_belts(name: str) -> None:
    """Compensated, the belt rests on the radii with the tension of its strain, to second order."""
    params = drive(CONTACTS[name], n_bodies=240)
    said = params.compliance
    tension, inside = at_rest(params)
    error = second_order(params)
    change = tension - EA * STRAIN
    assert abs(change - said.tension_change) < error * abs(change) + mesh_tension(params)
    assert said.relative_tension_change == pytest.approx(said.tension_change / (EA * STRAIN))
    # The depth follows the tension, which has errors of its own.
    rel = error + mesh_tension(params) / tension
    radii = np.array([[pulley.radius] * 2 for pulley in params.pulleys])
    np.testing.assert_allclose(said.tension, tension, rtol=rel)
    np.testing.assert_allclose(said.depth, np.column_stack([inside, inside]), rtol=rel)
    np.testing.assert_allclose(said.radius + said.depth, radii)
    if name != "stiff":
        assert abs(change) > 10.0 * (error * abs(change) + mesh_tension(params))
    if name in ("stiff", "softer"):
        return
    params = attrs.evolve(params, contact=attrs.evolve(params.contact, compensate=True))
    said = params.compliance
    compensated, off = at_rest(params)
    assert params.info["contact_strain"] == said.tension_change == 0.0
    assert not said.ratio_change.any()
    np.testing.assert_allclose(said.radius, radii)
    error, depth = second_order(params), said.depth[:, 0]
    shift = EA * float(np.sum(params.route.wraps * depth)) / params.belt.length
    assert abs(compensated - EA * STRAIN) < error * shift + mesh_tension(params)
    assert np.all(np.abs(off) < error * depth)
    # without: thirty times further off
    assert abs(change) > 30.0 * abs(compensated - EA * STRAIN)
    assert np.all(inside > 30.0 * np.abs(off))


def running_ratio(params: bd.Params) -> float:
    """Ratio of the speeds of pulley 1, which turns freely, and pulley 0, over two revolutions."""
    start = bd.settle(params).at_speed(params, {0: -20.0, 1: -10.0})
    motion = {0: bd.PiecewiseLinear([0.0], [-20.0])}
    free, times = bd.Viscous([0.0, 0.0]), [0.1, 0.4]
    result = bd.simulate(params, free, 0.4, motion=motion, initial=start, t_eval=times)
    turned = np.diff(result.pulleys.theta, axis=0)[0]
    return float(turned[1] / turned[0])


@pytest.mark.parametrize(
    ("name", "compensate"),
    first(3, [("soft", True), ("softer", False), ("quadratic", False),
              ("soft", False), ("softer", True), ("quadratic", True)]),
)  # fmt: skip
def test_running_ratio_of_an_unloaded_drive(name: str, compensate: bool) -> None:
    """Of unequal pulleys the smaller one loses more of its radius."""
    params = drive(attrs.evolve(CONTACTS[name], compensate=compensate))
    said = params.compliance.ratio_change[1]
    depth, share, l0 = params.compliance.depth[:, 0], shares(params), params.info["link_length"]
    radii = np.array([pulley.radius for pulley in params.pulleys])
    # Where it lands and leaves the belt is not in yet: over R sqrt(p/R), which a mesh cannot make
    # shorter than a link. The rim is faster there by up to p/R, and bristles carry that over the
    # wrap.
    landing = 2.0 * (radii * np.sqrt(share) + l0) / (np.array(params.route.wraps) * radii)
    allowed = float(np.sum(landing * share + 3.0 * share**2))
    found = running_ratio(params) * radii[1] / radii[0] - 1.0
    assert abs(found - said) < allowed
    if compensate:
        assert said == 0.0
        uncompensated = drive(CONTACTS[name]).compliance.ratio_change[1]
        assert abs(found) < 0.6 * abs(uncompensated)
    else:
        assert said == pytest.approx((depth[1] / radii[1] - depth[0] / radii[0]), rel=0.03)
        assert abs(said) > 2.0 * allowed


@functools.cache
def loaded(name: str) -> tuple[bd.Params, np.ndarray, float]:
    """Mean span tensions, and the creep of a reduction under load."""
    contact = CONTACTS | {
        "compensated": attrs.evolve(SOFT, compensate=True), "chosen": bd.Contact(),
    }  # fmt: skip
    params = drive(contact[name], radii=(0.05, 0.12))
    torque = bd.PiecewiseLinear([0.0, 0.2], [[0.0, 0.0], [-15.0, 0.0]]) + bd.Viscous([0.0, 3.0])
    result = bd.simulate(params, torque, 0.5, t_eval=np.linspace(0.4, 0.5, 400), ledger=False)
    rims = result.pulleys.omega.mean(axis=0) * [0.05, 0.12]
    return params, np.nanmean(result.span_tension, axis=0), float(1.0 - rims[1] / rims[0])


@pytest.mark.one_in(3)
@pytest.mark.parametrize(("name", "least"), [("soft", 0.3), ("compensated", 0.05), ("chosen", 0.0)])
def test_errors_under_load_against_a_contact_100_times_stiffer(name: str, least: float) -> None:
    """The estimates bound what runs show, and are not far above where there is much to show.

    The bound: a belt that sticks where it arrives. Bristles give, so that all of the wrap counts.
    """
    params, tension, creep = loaded(name)
    stiff, rigid, without = loaded("stiff")
    errors = compliance.compliance_error(params, tension, 1.45)
    own = compliance.compliance_error(stiff, rigid, 1.45)
    strain = float(np.ptp(tension)) / EA
    for quantity, difference in (
        ("span_mean", float(np.max(np.abs(tension - rigid))) / float(rigid.mean())),
        ("creep", abs(creep - without) / strain),
        ("speed", abs(creep - without)),
    ):
        # The reference has an error as well; both runs are on a mesh of 120 links, whose ripple of
        # tension and creep is the same to a part.
        assert least * errors[quantity] <= difference, quantity
        assert difference <= errors[quantity] + own[quantity] + 2e-3, quantity
    assert errors["tension"] == errors["span_mean"]
    assert 0.0 < errors["friction"] <= errors["span_mean"] + errors["speed"]
    if name == "soft":  # the mean of both ends stands for a wrap, to a tenth here
        change = compliance.compliance(params, tension, 1.45).tension_change
        change -= compliance.compliance(stiff, rigid, 1.45).tension_change
        assert float((tension - rigid).mean()) == pytest.approx(change, rel=0.15)
        assert change < -80.0


def test_a_chosen_contact_yields_a_hundredth_of_what_the_belt_does() -> None:
    params = drive()
    contact = params.effective_contact
    assert bd.Params(belt=params.belt, pulleys=params.pulleys).contact == bd.Contact()
    assert contact.linear == pytest.approx(100.0 * EA / 0.06**2)
    assert contact.damping == pytest.approx(math.sqrt(contact.linear * 0.1))
    assert contact.quadratic == 0.0 and contact.compensate is True
    assert params.compliance.creep_share == pytest.approx(0.01)
    assert shares(params).max() == pytest.approx(0.01 * STRAIN * (1.0 + STRAIN))
    for strain in (1e-4, 0.03, 0.0987):
        stretched = drive(length=params.info["path_length"] / (1.0 + strain))
        assert shares(stretched).max() < 1.1e-3
        assert stretched.effective_contact == contact  # neither the preload nor the mesh counts
    assert drive(n_bodies=300).effective_contact == contact
    assert drive(axial_stiffness=2 * EA).effective_contact.linear == 2.0 * contact.linear
    assert "compliance" not in str(params)
    uncompensated = drive(bd.Contact(compensate=False))
    assert uncompensated.effective_contact == attrs.evolve(contact, compensate=False)
    assert -0.01 < uncompensated.compliance.relative_tension_change < -0.001
    undamped = drive(bd.Contact(damping=0.0))
    assert undamped.effective_contact == attrs.evolve(contact, damping=0.0)


def test_what_a_contact_leaves_open() -> None:
    """Nothing, once it has a stiffness."""
    for contact in (bd.Contact(), bd.Contact(compensate=False), bd.Contact(damping=10.0), SOFT):
        text = drive(contact).to_toml()
        assert bd.Params.from_toml(text) == drive(contact)
        assert ("[contact]" in text) == (contact != bd.Contact())
    for contact in (bd.Contact(linear=1e7), bd.Contact(quadratic=1e11)):
        assert contact.damping == 0.0 and contact.compensate is False
        assert drive(contact).effective_contact is contact
    open_ = bd.Contact()
    assert (open_.linear, open_.damping, open_.compensate) == (None, None, True)
    assert "linear" in str(open_) and "chosen" in str(open_)


def test_tensions_at_both_sides_of_a_loaded_wrap() -> None:
    params = drive(SOFT)
    tension = np.array([300.0, 700.0])
    said = compliance.compliance(params, tension)
    np.testing.assert_array_equal(said.tension, [[700.0, 300.0], [300.0, 700.0]])
    for k, radius in enumerate((0.06, 0.12)):
        for side in (0, 1):
            pull = said.tension[k, side]
            want = pull * (1.0 + pull / EA) / radius
            assert SOFT.linear * said.depth[k, side] == pytest.approx(want, rel=1e-12)
    # the belt arrives on the other side when it runs the other way
    other = compliance.compliance(params, tension, -1e-9)
    for side, one in enumerate((said, other)):
        small, large = said.radius[:, side]
        assert one.ratio_change[1] == pytest.approx(small / 0.06 / (large / 0.12) - 1.0, abs=1e-15)
    # without a load creep is measured by a tenth of a per cent
    errors = compliance.compliance_error(params)
    assert set(errors) == {"tension", "span_mean", "speed", "creep", "friction", "power"}
    assert errors["creep"] == pytest.approx(1e3 * errors["speed"])
    assert errors["tension"] == -params.compliance.relative_tension_change
    made_up_for = drive(attrs.evolve(SOFT, compensate=True))
    assert not any(compliance.compliance_error(made_up_for).values())
    # rho A v^2 of the tension carries the belt round the curve
    fast = compliance.compliance(params, tension, 40.0)
    lighter = 0.1 * 40.0**2 / (np.array([[0.06], [0.12]]) * SOFT.linear)
    np.testing.assert_allclose(said.depth - fast.depth, np.broadcast_to(lighter, (2, 2)))
    assert not compliance.compliance(params, tension, 1e3).depth.any()


def line_of(params: bd.Params) -> str:
    (line,) = (one for one in str(params).splitlines() if "error of the contact: " in one)
    return line.split(": ", 1)[1]


def test_print_says_what_sinking_in_does() -> None:
    # 490 N less what it takes off, over 0.06 m and 2.5e7 N/m^2: 0.28 mm
    text = line_of(drive(SOFT))
    assert text.startswith("sinking into the pulleys: 0.28 mm on pulley 0 (0.46 % of its radius)")
    assert "76.1 N (16 %) off the tension" in text and "speed ratio by up to 0.3 %" in text
    assert text.endswith("adds some 78 % to creep")
    assert "speed ratio" not in line_of(drives.plain())
    compensated = line_of(drive(attrs.evolve(SOFT, compensate=True)))
    assert "runs on the pulleys' radii at the preload" in compensated and " N " not in compensated
    assert "chosen" in str(drive()) and "chosen" not in str(drive(SOFT))
    warned = str(drive(bd.Contact(linear=4e6, compensate=True)))
    assert "compliance: at the preload" in warned and "made up for at rest" in warned


def test_refused_values() -> None:
    for value in (1, 0.0, "yes"):
        with pytest.raises(TypeError, match=r"^contact\.compensate must be a bool, got"):
            bd.Contact(linear=1e7, compensate=value)  # type: ignore[arg-type]
    # a tenth of the radius is no small depth: 490 N on 0.06 m and 1e6 N/m^2 are 8 mm
    with pytest.raises(ValueError, match=r"^contact\.compensate: .* 0\.00822 m into pulley 0, at "
                                         r"most 0\.1 of its radius"):  # fmt: skip
        drive(bd.Contact(linear=1e6, compensate=True))
    drive(bd.Contact(linear=1e6))
    params = drive(SOFT)
    bad: list[Any] = [[1.0], [1.0, -1.0], [1.0, math.nan], [[1.0, 1.0]]]
    for tension in bad:
        with pytest.raises(ValueError, match=r"^tension must be 2 finite numbers >= 0"):
            compliance.compliance(params, tension)


def test_implicit_steps_hardly_mind_a_stiff_contact() -> None:
    """A hundred times stiffer has ten times the frequency, which explicit steps must follow."""
    steps, chosen = {"tsit5": [], "rodas4": []}, drive().effective_contact
    torque = bd.PiecewiseLinear([0.0, 0.2], [[0.0, 0.0], [-15.0, 0.0]])
    for scale in (1.0, 100.0):
        linear, damping = scale * chosen.linear, math.sqrt(scale) * chosen.damping
        params = drive(bd.Contact(linear=linear, damping=damping, compensate=True), n_bodies=60)
        given = {"initial": bd.settle(params), "ledger": False}
        for method, counted in steps.items():
            counted.append(bd.simulate(params, torque, 0.02, method=method, **given).stats.steps)
    assert steps["rodas4"][1] < 4.0 * steps["rodas4"][0], steps
    assert steps["tsit5"][1] > 5.0 * steps["tsit5"][0], steps


def test_numbers_out_of_all_proportion() -> None:
    """A contact that would take all of the strain is refused by name; where squares of its
    stiffness are no numbers any more it is right; and a radius with no square has no contact chosen
    for it.
    """
    stiff = drive(SOFT, axial_stiffness=1e150)
    for said in (lambda: stiff.compliance, lambda: str(stiff)):
        with pytest.raises(ValueError, match=r"contact\.linear is too small for belt\.axial_stiff"):
            said()
    stiffest = drive(axial_stiffness=1e300)
    assert stiffest.compliance.relative_depth.max() < 1e-3
    assert stiffest.compliance.tension == pytest.approx(stiffest.info["strain_tension"], rel=0.01)
    assert "belt line" in str(drive(axial_stiffness=1e150))  # too fast to be settled
    with pytest.raises(ValueError, match=r"contact\.linear must be finite"):
        assert drive(radii=(1e-170, 0.12)).compliance
