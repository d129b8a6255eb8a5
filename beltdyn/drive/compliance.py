"""Depth to which the belt sinks into its pulleys; its effect on tension, radii and creep.

MODEL section 3, "Where the belt runs". All is of first order in p / R. Left out are the ends of a
wrap (section 6, "Tension at rest"), in which friction acts further out, so that ratios change by
less than is said here, by a fifth at p / R = 0.5 %. Under load a belt whose bristles give does not
stick where it arrives but uses the whole wrap: creep then grows by less, and what is said of it
here is a bound.
"""

from __future__ import annotations

import attrs
import numpy as np
from numpy.typing import ArrayLike

from ..base.checks import Array
from ..base.rounding import percent
from .drive import Drive
from .span import Span

#: Least creep that errors of creep are measured by, 0.1 %: slip is measured no better.
CREEP = 1e-3


@attrs.frozen(kw_only=True, eq=False)
class Compliance:
    """Depth to which the belt sinks into its pulleys, and its effects.

    Arrays (n_p, 2) have a column for each end of the wrap: where the belt meets the pulley, counted
    in the order of the links, and where it leaves.

    Attributes:
        tension: Tension of the belt at the ends of each wrap (n_p, 2) [N].
        depth: Depth to which it has sunk in there (n_p, 2) [m].
        relative_depth: That over the pulley's radius (n_p, 2).
        radius: Radius on which it runs there (n_p, 2) [m]: that of the pulley less the depth, plus
            what a compensated contact begins further out.
        tension_change: Change of the mean tension by sinking in, axes fixed [N]; negative: less.
        relative_tension_change: That over the mean tension without it.
        ratio_change: Relative change of the speed ratio of each pulley to pulley 0, omega_k /
            omega_0, by the radii on which the belt arrives (n_p,).
        creep_share: Creep that the contact adds between two pulleys, as a share of that by the
            belt's stretch: EA / (c' R^2) of the pulley with the most, c' the stiffness of the
            contact at the depth there.
    """

    tension: Array
    depth: Array
    relative_depth: Array
    radius: Array
    tension_change: float
    relative_tension_change: float
    ratio_change: Array
    creep_share: float


def depth_under(
    params: Drive, radius: ArrayLike, tension: ArrayLike, speed: ArrayLike = 0.0
) -> Array:
    """Return the depth [m] in pulleys of some radii [m] under tensions [N] at speeds [m/s]."""
    return params._model.depth(*np.broadcast_arrays(radius, tension, speed))


def raised(params: Drive, radius: Array) -> Array:
    """Return how far outside of pulleys of some radii a compensated contact begins [m]."""
    if not params.effective_contact.compensate:
        return 0.0 * radius
    return depth_under(params, radius, params.info["strain_tension"])


def running_radius(params: Drive, radius: Array, tension: Array, flow: Array) -> Array:
    """Return the radius [m] on which belt runs under a tension [N]."""
    speed = Span(params.belt, tension, flow).speed
    return radius - depth_under(params, radius, tension, speed) + raised(params, radius)


def compliance(params: Drive, tension: ArrayLike | None = None, speed: float = 0.0) -> Compliance:
    """Return the depth to which the belt sinks into its pulleys, and its effects."""
    belt, info, radii = params.belt, params.info, params._radii
    rest = np.full((radii.size, 2), float(info["strain_tension"]))
    if tension is None:
        left = 1.0 - info["contact_strain"] / info["strain"]
        if not left > 0.0:
            raise ValueError(
                f"contact.linear is too small for belt.axial_stiffness = "
                f"{belt.axial_stiffness:.4g} N: sinking into the pulleys takes all of the belt's "
                f"strain of {info['strain']:.4g}"
            )
        pulls = left * rest
    else:
        after = np.asarray(tension, dtype=np.float64)
        if after.shape != radii.shape or not np.all(np.isfinite(after) & (after >= 0.0)):
            raise ValueError(
                f"tension must be {radii.size} finite numbers >= 0 (N), one for the span after "
                f"each pulley, got {tension!r}"
            )
        pulls = np.column_stack([np.roll(after, 1), after])
    depth = depth_under(params, radii[:, None], pulls, speed)
    smaller = depth - raised(params, radii[:, None])
    shorter = float(np.sum(params.route.wraps * smaller.mean(axis=1)))
    change = -belt.axial_stiffness * shorter / info["length"]
    arrives = (1.0 - smaller / radii[:, None])[:, 0 if speed >= 0.0 else 1]
    contact = params.effective_contact
    assert contact.linear is not None
    stiffness = contact.linear + 2.0 * contact.quadratic * depth
    return Compliance(
        tension=pulls,
        depth=depth,
        relative_depth=depth / radii[:, None],
        radius=radii[:, None] - smaller,
        tension_change=change,
        relative_tension_change=change / (float(pulls[:, 1].mean()) - change),
        ratio_change=arrives[0] / arrives - 1.0,
        creep_share=float(np.max(belt.axial_stiffness / (stiffness * radii[:, None] ** 2))),
    )


def compliance_error(
    params: Drive, tension: ArrayLike | None = None, speed: float = 0.0
) -> dict[str, float]:
    """Estimate the errors that a yielding contact makes, against pulleys that do not yield."""
    found = compliance(params, tension, speed)
    radii = params._radii
    arrives = 0 if speed >= 0.0 else 1
    strain = found.tension[:, arrives] / params.belt.axial_stiffness
    arm = 1.0 - found.radius / radii[:, None]
    # The fastest rim is that at which the belt arrives tightest.
    fastest = int(np.argmax(strain))
    lost = float(np.max(np.abs(arm[:, arrives] - arm[fastest, arrives])))
    shorter = float(np.max(np.abs(arm.mean(axis=1))))
    uneven = 0.5 * float(np.ptp(found.tension)) / float(found.tension[:, 1].mean())
    tensions = abs(found.relative_tension_change) + shorter * uneven
    return {
        "tension": tensions,
        "span_mean": tensions,
        "speed": lost,
        "creep": lost / max(CREEP, float(np.ptp(strain))),
        "friction": shorter,
        "power": lost,
    }


def describe(params: Drive) -> str:
    """Describe the effect of sinking into the pulleys on a drive at rest, in one line."""
    found = compliance(params)
    worst = int(np.argmax(found.relative_depth[:, 1]))
    depth, share = found.depth[worst, 1], found.relative_depth[worst, 1]
    ratio = float(np.max(np.abs(found.ratio_change)))
    if params.effective_contact.compensate:
        effect = ", which is made up for: it runs on the pulleys' radii at the preload"
    else:
        effect = (
            f", which takes {percent(params.info['contact_strain'])} off the strain, "
            f"{-found.tension_change:.3g} N ({percent(-found.relative_tension_change)}) off "
            "the tension"
        )
        if ratio > 0.0:
            effect += f" and changes the speed ratio by up to {100 * ratio:.1g} %"
    return (
        f"sinking into the pulleys: {1e3 * depth:.2g} mm on {params.label(worst)} "
        f"({percent(share)} of its radius){effect}; adds some {percent(found.creep_share)} "
        "to creep"
    )
