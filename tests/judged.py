"""Runs of random drives, each judged by a reference of its own.

A run claims an error: ``stats.error`` where there is one, else the ``rtol`` it was asked for. The
TRUE ERROR is the root mean square over the samples after the start and over the joints of the
difference of the joint force to a reference, over the mean tension of the reference. The reference
is a run at a tolerance far below, by a method of another family wherever that is affordable. Where
the run is off its claim, a second reference says how far the first is to be believed: the FLOOR,
the difference of the two; a run is told wrong only by what exceeds three floors. Where each
reference warns of its own accuracy, the closest two tell the floor: growth from so small errors may
be small all the same, and what they agree on is what the run has missed.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np
import random_drives

import beltdyn as bd

Array = np.ndarray[Any, np.dtype[np.float64]]
#: Method and tolerance, in the proportions they are drawn.
ASKED = [("auto", 1e-3), ("auto", 1e-4), ("auto", 1e-4), ("auto", 1e-5)]
ASKED += [("lbdf2", 1e-2), ("rodas4", 1e-3), ("tsit5", 1e-4), ("lie", 1e-2)]
FIXED = ("lbdf2", "lie", "rk4")
#: Warnings that speak of the integration over time; those of mesh and contact excuse nothing here.
IN_TIME = {"balance", "growth", "chatter", "undamped", "torque", "rough_torque", "slack_span"}
IN_TIME |= {"fallback", "fixed_step", "no_contact"}
SAMPLES = 60
#: Largest number of steps of a reference: some seconds.
MAX_REFERENCE_STEPS = 400_000
#: A hundredth of the tightest tolerance asked.
REFERENCE_RTOL = 1e-7


def options_of(seed: int, kind: str, params: bd.Params, t_end: float) -> dict[str, Any]:
    """Method and tolerance of a seed; one in eight has a fixed step."""
    rng = np.random.default_rng([seed, random_drives.KINDS.index(kind), 77])
    if rng.random() < 0.125:
        method = str(rng.choice(FIXED))
        if method == "rk4":  # stable up to 2.785
            return {"method": method, "step": rng.uniform(0.3, 2.5) / params.info["spectral_bound"]}
        return {"method": method, "step": min(random_drives.log_uniform(rng, 2e-6, 1e-4), t_end)}
    method, rtol = ASKED[int(rng.integers(len(ASKED)))]
    return {"method": method, "rtol": rtol}


def rates(params: bd.Params) -> tuple[float, float]:
    """Fastest vibration of joints and contact, and the fastest decay in either [1/s]."""
    belt, contact, info = params.belt, params.effective_contact, params.info
    sunk = info["strain_tension"] / (min(p.radius for p in params.pulleys) * contact.linear)
    stiff = contact.linear + 2.0 * contact.quadratic * sunk
    joints = 2.0 / info["link_length"] * math.sqrt(belt.axial_stiffness / belt.linear_density)
    vibration = max(joints, math.sqrt(stiff / belt.linear_density))
    return vibration, max(info["spectral_bound"], contact.damping / belt.linear_density)


def step_budget(params: bd.Params, t_end: float, options: dict[str, Any]) -> int:
    """Most steps a run should need, generously: beyond it goes nowhere for its cost.

    Twenty for a radian of the fastest vibration, where order 1 errs by (1/20)^2 / 2 = 1e-3 a step;
    explicit methods two more for a time constant of the fastest decay (they are stable up to 3.3 of
    them); and at events, links that touch or reverse, ten for each link a hundred times.
    """
    vibration, decay = rates(params)
    if "step" in options:  # made again, shorter, now and then
        return 10_000 + math.ceil(4.0 * t_end / options["step"])
    steps = 20.0 * vibration * t_end + 1000.0 * params.belt.n_bodies
    if options["method"] in ("tsit5", "auto"):
        steps += 2.0 * decay * t_end
    return math.ceil(steps)


def quiet(*args: Any, **options: Any) -> bd.Result:
    """``simulate`` without Python warnings: they are read off the result."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", bd.BeltdynWarning)
        return bd.simulate(*args, **options)


def turns(state: Any, params: bd.Params) -> Array:
    """Times the belt goes round each pulley (n_t, n_p), counter-clockwise.

    The turn of the line from link to link as seen from the axis, each less than half a turn.
    """
    x, y = np.atleast_2d(state.x), np.atleast_2d(state.y)
    found = []
    for pulley in params.pulleys:
        angle = np.arctan2(y - pulley.center[1], x - pulley.center[0])
        step = np.remainder(np.diff(angle, axis=1, append=angle[:, :1]) + math.pi, 2 * math.pi)
        found.append(np.sum(step - math.pi, axis=1) / (2 * math.pi))
    return np.column_stack(found)


def as_drawn(params: bd.Params) -> Array:
    """Times the belt is to go round each pulley (n_p,): not round one that lies on its back, but
    the other way round the second of a crossed belt.
    """
    outside = np.array([p.side == "outside" for p in params.pulleys])
    if outside.size == 2 and outside[1]:
        return np.array([-1.0, 1.0])
    return np.where(outside, 0.0, params.info["winding"])


def lost(result: bd.Result) -> list[int]:
    """Pulleys round which the belt does not go as drawn, at a sample or at the end."""
    params = result.params
    seen = np.vstack([turns(one, params) for one in (result.belt, result.final_state)])
    off = np.abs(seen - as_drawn(params)) > 0.5
    return [int(k) for k in np.flatnonzero(off.any(axis=0))]


def off_drawing(params: bd.Params, begin: bd.State) -> list[int]:
    """Pulleys that the settled belt does not go round as drawn, or does not touch.

    It is within a fifth of the radius of each, as contact yields, or between chord and tangent:
    long links cross the circle, and on a mesh of joints those round a small angle stay outside.
    """
    off = np.abs(turns(begin, params)[0] - as_drawn(params)) > 0.5
    half = 0.5 * params.info["link_length"]
    along = np.column_stack([np.cos(begin.phi), np.sin(begin.phi)])
    centers = params.centers(begin.travel) if params.mounted else params.centers()
    for k, (pulley, center) in enumerate(zip(params.pulleys, centers, strict=True)):
        to = center - np.column_stack([begin.x, begin.y])
        at = np.clip(np.sum(to * along, axis=1), -half, half)
        nearest = float(np.min(np.linalg.norm(to - at[:, None] * along, axis=1)))
        chord = math.sqrt(max(0.0, 1.0 - (half / pulley.radius) ** 2))
        tangent = math.sqrt(1.0 + (half / pulley.radius) ** 2)
        off[k] |= not chord - 0.2 < nearest / pulley.radius < max(1.2, tangent)
    return [int(k) for k in np.flatnonzero(off)]


def claim_of(result: bd.Result, options: dict[str, Any]) -> tuple[float | None, str]:
    """The error the run claims, and whether it is its own estimate or what was asked."""
    if result.stats.error is not None:
        return float(result.stats.error), "estimate"
    return (options["rtol"], "asked") if "rtol" in options else (None, "none")


@attrs.frozen
class Reference:
    force: Array
    name: str
    #: Warns of nothing in time; a torque function may jump by more than so tight a tolerance.
    sure: bool

    @property
    def tension(self) -> float:
        return float(np.mean(self.force))

    def error(self, force: Array) -> float:
        return float(np.sqrt(np.mean((force - self.force) ** 2)) / abs(self.tension))


def references(
    params: bd.Params,
    torque: bd.TorqueLike,
    t_end: float,
    begin: bd.State | None,
    times: Array,
    used: str,
    max_steps: int = MAX_REFERENCE_STEPS,
    tight: float = REFERENCE_RTOL,
    motion: Any = None,
) -> Iterator[Reference]:
    """Yield references one after the other, those unrelated to the method used first.

    ``tight`` is their tolerance; a larger one makes them cheaper where little is claimed.
    Their steps are at most a twentieth of the shortest period of a torque, of which the run has ten
    at most.
    """
    _, decay = rates(params)
    explicit = ("tsit5", tight)
    implicit = [("rodas4", tight), ("lbdf2", 10.0 * tight)]
    affordable = decay * t_end / 3.0 < max_steps
    if used == "tsit5":
        order = [implicit[0], ("tsit5", 0.1 * tight), implicit[1]]
    elif affordable:
        order = [explicit, *implicit]
    else:
        order = [implicit[1], implicit[0]] if used == "rodas4" else implicit
    for method, rtol in order:
        if method == "tsit5" and not affordable:
            continue
        try:
            result = quiet(
                params, torque, t_end, motion, t_eval=times, initial=begin, method=method,
                rtol=rtol, max_steps=max_steps, max_step=t_end / 200.0, ledger=False,
            )  # fmt: skip
        except bd.SimulationError:
            continue
        sure = not IN_TIME & {one.code for one in result.warnings}
        yield Reference(result.joints.force, f"{method} {rtol:g}", sure)


def judge(
    seed: int,
    kind: str = "any",
    max_steps: int = MAX_REFERENCE_STEPS,
    radians: float = random_drives.RADIANS,
    *,
    many: bool = False,
) -> dict[str, Any]:
    """Run the drive of a seed and say what it claimed, what it said, and what was true.

    The record's ``outcome``: "settle" (failed by name while settling), "failed" (by name),
    "no_reference" (none of at most so many steps), "doubtful" (off its claim, but not by three
    floors) or "known". "over": it went beyond its budget of steps; "off_drawing": the pulleys
    that the belt does not lie on as drawn.

    ``many`` judges at less cost: a run that warns of its accuracy in time has the outcome "warned",
    and the tolerance of the first reference is a hundredth of the claim, which is enough where the
    run is as right as it claims; where it is not, the references are as ever.
    """
    params, torque, t_end, drawn = random_drives.draw(seed, kind, radians)
    options = options_of(seed, kind, params, t_end)
    record: dict[str, Any] = {"seed": seed, "kind": kind, "outcome": "", "t_end": t_end}
    record |= {"n_b": params.belt.n_bodies, "method": options["method"], "drawn": drawn}
    record |= dict.fromkeys(("rtol", "step", "claim", "error", "largest", "floor")) | options
    record |= {"over": False, "stats": {}, "warnings": [], "lost": [], "off_drawing": []}
    record |= {"symbol": "", "claimed_by": "none", "reference": ""}
    try:
        begin = random_drives.start(params, drawn)
    except bd.SimulationError as failure:
        return record | {"outcome": "settle", "symbol": failure.symbol}
    record["off_drawing"] = off_drawing(params, begin)
    times = np.sort(np.random.default_rng([seed, 78]).uniform(0.0, t_end, SAMPLES - 1))
    times = np.append(times, t_end)
    budget = record["budget"] = step_budget(params, t_end, options)
    try:
        result = quiet(
            params, torque, t_end, t_eval=times, initial=begin, max_steps=budget, **options
        )
    except bd.SimulationError as failure:
        record |= {"outcome": "failed", "symbol": failure.symbol, "text": str(failure)}
        record["over"] = failure.symbol == "BD_ERR_MAX_STEPS"
        part = failure.result
        return record if part is None else record | {"stats": attrs.asdict(part.stats)}
    claim, by = claim_of(result, options)
    record |= {
        "claim": claim,
        "claimed_by": by,
        "stats": attrs.asdict(result.stats),
        "warnings": [one.code for one in result.warnings],
        "accuracy": [one.code for one in result.warnings if one.code in IN_TIME],
        "lost": lost(result),
        "largest_residual": float(np.max(np.abs(result.energy.residual))),
        "passed": float(result.energy.passed[-1]),
        "top_omega": float(np.max(np.abs(result.pulleys.omega))),
    }
    if many and record["accuracy"]:
        return record | {"outcome": "warned"}
    given = (params, torque, t_end, begin, times, result.stats.method, max_steps)
    if many and claim is not None and 0.01 * claim > REFERENCE_RTOL:
        loose = next(references(*given, min(0.01 * claim, 1e-5)), None)
        if loose is not None and (error := loose.error(result.joints.force)) <= claim:
            return record | {"outcome": "known", "error": error, "reference": loose.name}
    known = references(*given)
    seen: list[Reference] = []
    for one in known:
        seen.append(one)
        if one.sure:
            break
    if not seen:
        return record | {"outcome": "no_reference"}
    first = seen[-1] if seen[-1].sure else seen[0]
    error = first.error(result.joints.force)
    kept = error <= (claim if claim is not None else 0.01)
    record |= {
        "outcome": "known" if first.sure or kept else "doubtful",
        "error": error,
        "largest": float(np.max(np.abs(result.joints.force - first.force)) / abs(first.tension)),
        "tension": first.tension,
        "reference": first.name,
    }
    if not kept:
        others = [one for one in known if one.sure] if first.sure else seen[1:]
        floor = min((first.error(one.force) for one in others), default=math.inf)
        record |= {
            "outcome": "known" if error > 3.0 * floor else "doubtful",
            "floor": floor if others else None,
            "reference": ", ".join(one.name for one in (first, *others)),
        }
    return record
