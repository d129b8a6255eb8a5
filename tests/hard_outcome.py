"""How a run of a hard scene ends, and whether that is one of the two outcomes there may be: a
result within its invariants and the error it claims, or an error by name with what was computed.

An outcome is one of KINDS. The true error is that of `judged.py`: against a reference at a
tolerance far below, over the mean tension. Where the scene has a theory, the run must keep that as
well: its ``deviation``, over what the theory allows, is at most 1.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any, Protocol

import attrs
import judged
import numpy as np
import random_drives

import beltdyn as bd
from beltdyn.base import run_warnings

#: solved: finished, theory and invariants kept, and the error, where a reference exists, at most
#: FACTOR times what it claims.
#: said: finished, less accurate than that or of unknown accuracy, and warns of that by name.
#: refused: ended by an error that names time and reason and hands over what was computed.
#: budget: more steps than such a run should need.
#: unjudged: finished within its invariants without a word, and no reference knows better.
#: quiet: an error larger than claimed without a word. broken: NaN, a broken invariant.
KINDS = ("solved", "said", "refused", "budget", "unjudged", "quiet", "broken")
#: As in `test_claims.py`: an estimate from the run alone is worth its order of magnitude.
FACTOR = 5.0
#: Where neither an estimate nor a tolerance claims anything, with FACTOR: a tenth.
UNCLAIMED = 0.1 / FACTOR
#: A claim above this share of the tension claims nothing.
MOST_CLAIMED = 0.1
#: Where nothing moves, claims may be below what rounding does to a reference.
ROUNDING = 1e-9
#: Share of the energy transmitted that the ledger may be off without, and with, a warning.
BALANCE, BALANCE_WARNED = 0.02, 0.5
#: Largest number of steps of a reference.
MAX_REFERENCE_STEPS = 40_000


class Hard(Protocol):
    """What is asked of a scene of ``bd.scenes.hard``."""

    params: bd.Params
    torque_fn: bd.TorqueLike
    t_end: float
    motion: Any
    name: str
    expects: str | None
    options: dict[str, Any]

    def initial(self) -> bd.State | None: ...
    def deviation(self, result: bd.Result) -> float | None: ...
    def run(self, method: str = "auto", **options: Any) -> bd.Result: ...


@attrs.frozen
class Outcome:
    kind: str
    symbol: str = ""  # of the error
    error: float | None = None  # root mean square of joint forces over the mean tension
    deviation: float | None = None  # from theory, over what it allows
    claim: float | None = None
    invariant: float | None = None  # the worst over its bound
    broken: str = ""  # which was the worst
    cpu: float = 0.0  # of the run without settling [s]
    steps: int = 0
    warnings: tuple[str, ...] = ()
    text: str = ""


# ---------------------------------------------------------------- invariants


def bound_of(law: bd.Friction | None) -> float:
    """Largest |mu| of a law; NaN where dampers or a viscous part add to it what has no bound."""
    if law is None:
        return 0.0
    if isinstance(law, bd.ElasticPlastic | bd.MaxwellSlip):
        return math.nan  # bounds a force, of a normal force that changes
    if isinstance(law, bd.LuGre) and (law.damping or law.viscous):
        return math.nan
    kinetic = getattr(law, "mu_k", None) or getattr(law, "mu", 0.0)
    return float(max(kinetic, getattr(law, "mu_s", 0.0)))


def invariants(result: bd.Result) -> dict[str, float]:
    """What must hold at every sample and at the end, each over its bound: at most 1 is kept."""
    params, end, energy = result.params, result.final_state, result.energy
    touch, found = result.contact, {}
    groups = (result.belt, result.joints, touch, result.pulleys)
    arrays = [array for group in groups for array in group.arrays().values()]
    arrays += [end.x, end.y, end.vx, end.vy, end.vphi, end.mu, end.omega]
    if energy is not None:
        arrays += list(energy.arrays().values())
    finite = all(np.all(np.isfinite(array)) for array in arrays)
    found["finite"] = 0.0 if finite else math.inf
    if not finite:
        return found
    found["N >= 0"] = math.inf if np.any(touch.normal < 0.0) else 0.0
    most = np.array([bound_of(params.friction_on(k)) for k in range(len(params.pulleys))])
    touching = touch.pulley >= 0
    at = most[touch.pulley[touching]]
    held = np.abs(touch.mu[touching])[at > 0.0] / at[at > 0.0]
    found["mu"] = float(np.max(held, initial=0.0)) / (1.0 + 1e-9)
    gap = np.max(np.abs(result.joints.deformation), initial=0.0)
    found["ring"] = float(gap / params.info["link_length"])
    if not result.warnings and judged.lost(result):
        found["ring"] = math.inf
    if energy is not None:
        warned = "balance" in {one.code for one in result.warnings}
        found["ledger"] = result.stats.balance / (BALANCE_WARNED if warned else BALANCE)
        # Not those of mounts: dry friction in a pivot hands back what its bristles hold.
        names = ("joint_loss", "contact_loss", "drag_loss")
        of_all = np.max(energy.passed + np.abs(energy.total))  # gravity makes totals negative
        slack = np.max(np.abs(energy.residual)) + 1e-7 * of_all
        for loss in (getattr(energy, name) for name in names):
            if loss is not None:
                fall = np.max(np.maximum.accumulate(loss) - loss)
                found["losses"] = max(found.get("losses", 0.0), float(fall / (slack or 1.0)))
    own = getattr(result.stats, "invariant", None)
    return found if own is None else found | {"core": float(own)}


def worst(result: bd.Result) -> tuple[float, str]:
    found = invariants(result)
    name = max(found, key=found.__getitem__)
    return found[name], name


# ---------------------------------------------------------------- runs


def is_named(failure: bd.SimulationError) -> bool:
    """It says when, why and what to try, and has what was computed; settling has no result."""
    settling = failure.symbol == "BD_ERR_NOT_SETTLED" or failure.result is None
    return bool(failure.symbol and len(str(failure)) > 40) and (
        settling or (math.isfinite(failure.t) and failure.result is not None)
    )


@attrs.frozen
class Ended:
    """A run without a judgement of its error; `force` None where there is nothing to judge."""

    outcome: Outcome
    t: Any = None
    force: Any = None


def ended(call: Callable[[], bd.Result], options: dict[str, Any], expects: str | None) -> Ended:
    """Run, and say how it ended; the outcome of a result is "" as long as its error is unknown."""
    begun = time.process_time()
    try:
        result = call()
    except (bd.SimulationError, ValueError) as failure:
        symbol = getattr(failure, "symbol", "ValueError")
        part = getattr(failure, "result", None)
        cpu, text = time.process_time() - begun, str(failure)
        steps, wrong, which = 0, 0.0, ""
        if part is not None:
            steps, cpu = part.stats.steps, part.stats.cpu_time
            if symbol not in ("BD_ERR_NOT_FINITE", "BD_ERR_BALANCE", expects):
                wrong, which = worst(part)
        kind = "budget" if symbol in ("BD_ERR_MAX_STEPS", "BD_ERR_STALLED") else "refused"
        unnamed = isinstance(failure, bd.SimulationError) and not is_named(failure)
        if unnamed or symbol == "BD_ERR_INVARIANT" or wrong > 1.0:
            kind = "broken"
        elif symbol == expects:
            kind = "solved"
        return Ended(Outcome(kind, symbol, None, None, None, wrong, which, cpu, steps, (), text))
    wrong, which = worst(result)
    claim, _ = judged.claim_of(result, options)
    found = Outcome(
        "broken" if wrong > 1.0 else "",
        claim=claim,
        invariant=wrong,
        broken=which,
        cpu=result.stats.cpu_time,
        steps=result.stats.steps,
        warnings=tuple(dict.fromkeys(one.code for one in result.warnings)),
        text=result.message,
    )
    return Ended(found, result.t, result.joints.force)


class Judge:
    """Runs a scene by several methods, each judged by the same references."""

    def __init__(
        self, scene: Hard, max_steps: int = MAX_REFERENCE_STEPS, *, theory: bool = True
    ) -> None:
        """theory: whether to ask it; of another belt, as the paper's mesh, it may not be true."""
        self.scene, self.max_steps, self.theory = scene, max_steps, theory
        self._known: list[judged.Reference] = []
        self._more: Any = None

    @property
    def rtol(self) -> float:
        return float(self.scene.options.get("rtol", 1e-4))

    def budget(self, method: str) -> int:
        """Steps that the run should need at most; "rk4" makes some four in a time constant."""
        scene = self.scene
        options = {"method": method} | scene.options
        if method in ("auto", "tsit5", "rodas4"):
            options.pop("step", None)  # the first one alone
        elif method == "rk4":
            options |= {"step": 1.0 / sum(judged.rates(scene.params))}
        return judged.step_budget(scene.params, scene.t_end, options)

    def run(self, method: str, budget: int | None = None, **options: Any) -> Ended:
        """Run without judging the error; ``deviation`` from theory is in the outcome."""
        scene = self.scene
        asked = {"rtol": self.rtol, **scene.options, **options}
        if method == "rk4":
            asked.pop("rtol")
        results: list[bd.Result] = []

        def call() -> bd.Result:
            result = scene.run(method, max_steps=budget or self.budget(method), **options)
            results.append(result)
            return result

        with run_warnings.silenced():
            found = ended(call, asked, scene.expects)
            away = scene.deviation(results[0]) if results and self.theory else None
        return attrs.evolve(found, outcome=attrs.evolve(found.outcome, deviation=away))

    def references(self, t: Any, enough: int) -> list[judged.Reference]:
        """So many at most; those that warn of their own accuracy are left out."""
        scene = self.scene
        if self._more is None:
            self._more = judged.references(
                scene.params, scene.torque_fn, scene.t_end, scene.initial(), t, "auto",
                self.max_steps, motion=scene.motion,
            )  # fmt: skip
        while len(self._known) < enough:
            found = next(self._more, None)
            if found is None:
                break
            if found.sure and np.all(np.isfinite(found.force)):
                self._known.append(found)
        return self._known[:enough]

    def _error(self, run: Ended) -> tuple[float | None, bool | None]:
        """The true error, and whether it is as claimed: None where references do not tell."""
        claim = UNCLAIMED if run.outcome.claim is None else run.outcome.claim
        error: float | None = None
        for first in self.references(run.t, 1):
            error = first.error(run.force)
            if error <= max(FACTOR * claim, ROUNDING):
                return error, True
        if len(known := self.references(run.t, 2)) < 2 or error is None:
            return error, None
        floor = known[0].error(known[1].force)
        return error, None if error <= 3.0 * floor else False

    def judge(self, run: Ended) -> Outcome:
        """Add the kind, and the error where there is no theory to tell it."""
        found = run.outcome
        if found.kind:
            return found
        said = bool(judged.IN_TIME & set(found.warnings))
        error, right = self._error(run)
        found = attrs.evolve(found, error=error)
        if found.deviation is not None and found.deviation > 1.0:
            # By its own estimate it may be as far off as it is, though that was not asked for.
            said |= bool(right) and (found.claim or 0.0) > 10.0 * self.rtol
            right = False
        elif found.deviation is not None:
            right = right is not False
        if said and (found.claim or 0.0) > MOST_CLAIMED:
            right = None
        if right:
            kind = "solved"
        elif said:
            kind = "said"
        else:
            kind = "unjudged" if right is None else "quiet"
        return attrs.evolve(found, kind=kind)


def outcome(scene: Hard, method: str = "auto", budget: int | None = None) -> Outcome:
    judge = Judge(scene)
    return judge.judge(judge.run(method, budget))


# ---------------------------------------------------------------- random drives


#: Most steps of a random drive that is only asked to stand, and its length: a few dozen steps.
STEPS, RADIANS = 200, 0.002 * random_drives.RADIANS


def stands(seed: int) -> dict[str, Any]:
    """Run a varied random drive for a few dozen steps; no reference.

    The record's ``kind``: "kept" (its invariants), "cut" (after STEPS steps, invariants kept so
    far), "settle" and "refused" (an error by name, while settling or later), "broken".
    """
    params, torque, t_end, drawn = random_drives.draw(seed, "varied", RADIANS)
    options = judged.options_of(seed, "varied", params, t_end)
    record = {"seed": seed, "method": options["method"], "symbol": "", "text": ""}
    try:
        begin = random_drives.start(params, drawn)
    except bd.SimulationError as failure:
        return record | {"kind": "settle", "symbol": failure.symbol}
    times = np.linspace(begin.t, begin.t + t_end, 5)

    def call() -> bd.Result:
        return judged.quiet(
            params, torque, t_end, t_eval=times, initial=begin, max_steps=STEPS, **options
        )

    found = ended(call, options, None).outcome
    kind = {"": "kept", "budget": "cut"}.get(found.kind, found.kind)
    record |= {"kind": kind, "steps": found.steps, "invariant": found.invariant}
    return record | {"symbol": found.symbol, "which": found.broken, "text": found.text}
