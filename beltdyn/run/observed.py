"""Implausible data and unexpected behaviour, as found in the samples of a run.

Every limit below stands with the argument for it. They lead to warnings only; nothing is refused
or changed.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator

import numpy as np

from ..base.naming import span_names
from ..base.rounding import rounded
from ..base.run_warnings import RunWarning
from ..drive import cells, sanity
from ..drive.couplings import OverrunningClutch
from ..drive.params import Params
from ..outputs.arcs import gross_slip
from ..outputs.averages import durations, span_of
from ..outputs.sampled import slowed
from ..outputs.selection import has
from ..outputs.squeal import squeals
from ..result.result import Result

#: A torque this many times 2 T R, what is carried when all tension has gone to one side.
TORQUE = 10.0
#: Turned further than this a rim runs, and does not only give way to a belt that is loaded: their
#: strain of some 1 % moves belts by a few hundredths of a radius [rad].
TURNED = 0.1


def observe(result: Result, moved: Collection[int] = ()) -> tuple[RunWarning, ...]:
    """Return the warnings that show in a run's samples; ``moved``: pulleys without set torque."""
    if result.t.size == 0:
        return tuple(_mesh(result))
    with np.errstate(all="ignore"):  # a failed run may end with huge numbers
        found = {
            "no_friction": _no_friction(result),
            "mesh": _mesh(result),
            "mesh_speed": _mesh_speed(result),
            "units": _torques(result, moved),
            "full_slip": _full_slip(result, moved),
            "slack_span": _slack_spans(result),
            "never_drives": _backward_clutches(result),
            "near_limit": _near_limits(result),
            "squeal": _squeals(result),
        }
        looked_for = (code for code in found if code not in result.unchecked)
        return tuple(one for code in looked_for for one in found[code])


def _no_friction(result: Result) -> Iterator[RunWarning]:
    params, pulleys = result.params, result.pulleys
    if params.has_friction:
        return
    fed = pulleys.torque * pulleys.omega
    first, driven = np.unravel_index(int(np.argmax(fed > 0.0)), fed.shape)
    if fed[first, driven] > 0.0:
        yield RunWarning(
            code="no_friction",
            text=f"{params.label(int(driven))} is driven, with up to "
            f"{np.nanmax(fed[:, driven]):.3g} W, but friction is off, so the belt "
            "transmits nothing: set Params.friction",
            t=float(result.t[first]),
            where=params.label(int(driven)),
        )


def _mesh(result: Result) -> Iterator[RunWarning]:
    """Warn of the error of the mesh in the result; of a run that failed, of that at rest."""
    params, error, seen = result.params, result.accuracy["span_mean"].space, result._running
    if error is None or seen is None:
        return sanity.of_mesh(params)
    return sanity.of_mesh(params, error, seen.shaking, seen.rim_speed)


def _mesh_speed(result: Result) -> Iterator[RunWarning]:
    slower = slowed(result)
    if slower is not None:
        yield from sanity.of_speeds(result.params, *slower)


def _torques(result: Result, moved: Collection[int]) -> Iterator[RunWarning]:
    params, pulleys = result.params, result.pulleys
    info = params.info
    added = params.belt.axial_stiffness * info["mesh_strain"]
    tension = params.belt.preload or info["strain_tension"] + added
    carried = 2.0 * tension * params._radii
    size = np.abs(pulleys.torque)
    size[:, list(moved)] = 0.0
    # in a twentieth of the samples: a controller may set extreme torques for a moment
    over = np.quantile(size, 0.95, axis=0) / carried
    worst = int(np.argmax(over))
    if over[worst] > TORQUE:
        most = size[:, worst].max()
        yield sanity.units(
            f"a torque of {most:.3g} N m acts on {params.label(worst)}, but a belt of "
            f"{tension:.3g} N transmits at most {carried[worst]:.3g} N m: is it in N mm?",
            params.label(worst),
            t=float(result.t[np.argmax(size[:, worst] > TORQUE * carried[worst])]),
        )


def _full_slip(result: Result, moved: Collection[int]) -> Iterator[RunWarning]:
    params = result.params
    found = gross_slip(result) if params.has_friction else None
    if found is None:
        return
    lasts = durations(result.t)
    for k, pulley in enumerate(params.pulleys):
        slips = found.slips[:, k]
        if not slips.any():
            continue
        when = result.t[slips]
        carried = float(found.carried[k]) * pulley.radius
        given = float(np.max(np.abs(result.pulleys.torque[slips, k])))
        of_set = f", of up to {given:.3g} N m set" if given > carried and k not in moved else ""
        # without a torque of its own it slips for its inertia and its drag
        less = ", lay more belt round it or change speed more slowly"
        less = " or lower the torque" if given > 0.0 else less
        yield RunWarning(
            code="full_slip",
            text=f"{params.label(k)} slips over its whole wrap, by {found.slip_distance[k]:.2g} m, "
            f"for {np.sum(lasts[slips]):.3g} s {span_of(when)}, which dissipates "
            f"{found.lost[k]:.3g} J: friction transmits {carried:.3g} N m in the mean of that "
            f"time{of_set}; {_tighter(params)}{less}{sanity.corners(params, k)}",
            t=float(when[0]),
            where=params.label(k),
        )


def _tighter(params: Params) -> str:
    """Describe how the belt gets more tension."""
    if params.belt.preload is not None:
        return "raise belt.preload"
    return "raise the preload (a shorter belt.length)"


def _backward_clutches(result: Result) -> Iterator[RunWarning]:
    """Warn of clutches under a rim that turns the other way: they drive nothing, or brake it."""
    params, run = result.params, result.couplings
    for c, k in enumerate(params.coupled):
        clutch = params.pulleys[k].coupling
        if run is None or not isinstance(clutch, OverrunningClutch):
            continue
        speed = float(np.mean(run.rim_speed[:, c])) * (-1.0 if clutch.clockwise else 1.0)
        turned = speed * (result.t[-1] - result.t[0])
        # while the hub still runs as its rim the clutch catches now and then, and brakes it
        driven = float(np.mean(run.transmitted[:, c] * result.pulleys.omega[:, k]))
        if turned < -TURNED and driven <= 0.0:
            drives = "clockwise" if clutch.clockwise else "counter-clockwise"
            yield RunWarning(
                code="never_drives",
                text=f"the clutch of {params.label(k)} drives nothing: its rim turns with "
                f"{abs(speed):.3g} rad/s the other way than {drives}, in which the clutch drives: "
                f"is clockwise={not clutch.clockwise} meant?",
                where=params.label(k),
            )


def _slack_spans(result: Result) -> Iterator[RunWarning]:
    # Span tensions are costly to compute, so only at samples where any joint has no tension.
    of_joints = has(result.outputs, "joints.force")
    forces = result.joints.force if of_joints else result.span_tension
    rows = np.flatnonzero((forces <= 0.0).any(axis=1))
    if rows.size == 0:
        return
    params, n_p = result.params, len(result.params.pulleys)
    tension = result._span_tension(rows)
    off = np.zeros((rows.size, n_p), dtype=bool)  # the belt, its pulley
    if of_joints and has(result.outputs, "contact.pulley"):
        touched = result.contact.pulley[rows]
        off = np.stack([~(touched == j).any(axis=1) for j in range(n_p)], axis=1)
    lasts = durations(result.t)
    for k in range(n_p):
        slack = np.zeros(result.t.size, dtype=bool)
        slack[rows] = (tension[:, k] <= 0.0) | off[:, k] | off[:, (k + 1) % n_p]
        if not slack.any():
            continue
        when = result.t[slack]
        least = np.min(tension[:, k], where=tension[:, k] <= 0.0, initial=np.inf)
        down = f"down to {least:.3g} N" if least <= 0.0 else "the belt off a pulley at its end"
        yield RunWarning(
            code="slack_span",
            text=f"span {k}, from {params.label(k)} to {params.label((k + 1) % n_p)}, is slack, "
            f"{down}, for {np.sum(lasts[slack]):.3g} s {span_of(when)}; "
            f"{_tighter(params)} or lower the torque; "
            "how a slack span becomes tight again may depend on very small differences, so "
            "the error is unknown",
            t=float(when[0]),
            where=f"span {span_names(params.pulley_names)[k]}",
            accuracy=True,
        )


def _near_limits(result: Result) -> Iterator[RunWarning]:
    """Warn of spans of an ALE belt that came near what it does not describe."""
    params, has = result.params, result._has
    if not params._flows:
        return
    tension = result.span_tension if has("span_tension") else None
    flow = result.belt.flow if has("belt.flow") else None
    deflection = result.spans.deflection if has("spans.deflection") else None
    for code, text, row, k in cells.seen(params, tension, flow, deflection):
        name = span_names(params.pulley_names)[k]
        yield RunWarning(
            code=code,
            text=f'span {name} {text}; Belt(mesh="joint") describes it',
            t=float(result.t[row]),
            where=f"span {name}",
            accuracy=True,
        )


def _squeals(result: Result) -> Iterator[RunWarning]:
    """Warn of friction that makes vibrations on the contact grow, which an ALE belt has none of."""
    params, has = result.params, result._has
    needed = ("contact.pulley", "contact.mu")
    if not (params._flows and params.has_friction and all(map(has, needed))):
        return
    for one in squeals(params, result.t, result.contact.pulley, result.contact.mu):
        t, label = float(result.t[one.first]), params.label(one.pulley)
        yield RunWarning(
            code="squeal",
            text=f"friction on {label}, {one.coefficient:.2g} in the rms of its wrap, makes "
            f"vibrations of the belt on the contact grow, at {one.frequency:.3g} Hz by a factor of "
            f"e in {one.time:.2g} s, from t = {t:.4g} s on, as they have {one.damping:.2g} of "
            'critical damping; the mesh "ale" has no such vibrations, which take friction away and '
            "can make the pulley slip in full: tensions may be off by several percent; compare "
            f'with Belt(mesh="joint"), or give contact.damping >= {one.needed:.3g} N s/m^2',
            t=t,
            where=label,
            accuracy=True,
        )


def hint(result: Result, rtol: float) -> tuple[str, ...]:
    """Return a note where an ALE belt would be much cheaper, and note what the run has shown."""
    params, stats, seen = result.params, result.stats, result._running
    time = float(result.t[-1] - result.t[0]) if result.t.size else 0.0
    if seen is None or not time > 0.0 or params._flows:
        return ()
    steps = stats.steps + stats.rejected
    times = cells.cheaper(params, max(0, steps - stats.nlu), stats.nlu, rtol, time)
    if not times or (other := cells.instead(params)) is None:
        return ()
    if result._has("span_tension"):  # NaN where no link of a span is free
        tension = np.nan_to_num(result.span_tension, nan=params.info["strain_tension"])
        limits = cells.seen(other, tension, np.full(result.t.size, seen.rim_speed), None)
        if any(code == "near_slack" for code, *_ in limits):
            return ()
    figures = times, cells.landings(params, seen.rim_speed), steps / time
    shown = [f"{rounded(one, None)[0]:g}" for one in figures]
    return (
        f'Belt(mesh="ale") would take some {shown[0]} times less CPU time: the belt flows through '
        f"cells there and no links land; here, in each simulated second, {shown[1]} links land on "
        f"pulleys or leave them and the run takes {shown[2]} steps",
    )
