"""A run verified by other runs: an unrelated or tighter integration, and other meshes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from typing import Any

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array
from ..base.run_options import Options
from ..drive.compliance import compliance_error
from ..drive.params import Params
from ..drive.scene import Scene
from ..many.outcome import Outcome, attempt
from ..many.pools import Pool, as_pool
from ..outputs.accuracy_report import SPACE_FLOOR, TIME_FLOOR, Accuracy, QuantityError
from ..outputs.sampled import known
from ..outputs.state import SPEEDS, State
from ..result.result import Result
from .quantities import (
    HISTORIES,
    OBSERVED,
    QUANTITIES,
    Observed,
    differences,
    observe,
    with_links,
)
from .runs import Done, Reached, Runs, apart_from, evaluated_in_core
from .space import space_error

#: Links of the other meshes over those of the run. The finer one costs about twice as much as the
#: run, the coarser one half.
COARSE, FINE = 0.5, 1.5
#: Tolerance of the check in time over that of the run.
TIGHTER = 0.1
#: Meshes differ so much that their integration need not be better than this.
MESH_RTOL = 1e-3
#: A step of "tsit5" is stable up to about this over the joints' spectral bound.
STABLE = 3.2
#: The check in time may cost this many times the run.
AFFORDABLE = 2.0
#: From this part of the run on the check in time can begin, by the method that it is likely to
#: need: the same with so many times the steps that the run seems to take, or so many times fewer.
BEGUN, SURELY = 0.25, 1.5
#: Means of two integrations agree by chance if they do so better than this share of the tensions'
#: histories.
CHANCE = 0.03
#: Integrations whose tensions differ by so many times the tolerance have parted.
PARTED, PARTED_RTOL = 100.0, 1e-4
#: Histories are judged if they are known over this part of the run.
JUDGED = 0.1


#: Runs a scene with options, and settles a drive.
Simulate = Callable[..., Result]
Settle = Callable[..., State]


class Verification:
    """The runs that verify one run, begun before it and closed after it."""

    # The other meshes begin in a second thread, if the core evaluates the torques alone, and the
    # check in time there as well as soon as it is known by which method; functions of the user are
    # called from this thread only, and their runs follow one another.

    def __init__(
        self,
        simulate: Simulate,
        settle: Settle,
        scene: Scene,
        initial: State | None,
        times: Array,
        options: Options,
    ) -> None:
        self._settle = settle
        self._scene, self._params, self._initial = scene, scene.params, initial
        common = {"step": None, "max_steps": None, "ledger": False, "outputs": OBSERVED}
        self._runs = Runs(scene, simulate, settle, t_eval=times, options=common)
        self._method, self._rtol, self._step = options.method, options.rtol, options.step
        self._pool: Pool | None = None
        #: Runs begun in the other thread, by ratio of the mesh or method of the check in time.
        self._begun: dict[float | str, Future[Outcome]] = {}
        if evaluated_in_core(self._scene):
            self._pool = as_pool(1)
            # What has not begun when this thread is free is run here.
            for ratio in (COARSE, FINE):
                self._begun[ratio] = self._pool.submit(self._on_mesh, ratio)

    def watch(self, reached: Reached) -> None:
        """Start the check in time, the longest run, as soon as its method can be chosen."""
        start, end = reached.start.t, self._scene.t_end
        part = (reached.t - start) / (end - start)
        if self._pool is None or len(self._begun) > len((COARSE, FINE)) or part < BEGUN:
            return
        if self._method == "auto" and reached.method == "tsit5":
            return  # it may still change
        methods = {
            self._methods(reached.method, share * reached.steps / part, end - start)[0]
            for share in (1.0 / SURELY, SURELY)
        }
        if len(methods) > 1:
            return
        method = methods.pop()
        self._begun[method] = self._pool.submit(self._check_time, method, reached.start)
        if self._begun[FINE].cancel():
            self._begun[FINE] = self._pool.submit(self._on_mesh, FINE)

    def close(self) -> None:
        """Stop the runs that have not ended."""
        if self._pool is not None:
            self._pool.close(ended=True)

    def judge(self, result: Result, start: State) -> Accuracy:
        """Return the accuracy of the run, once it has finished."""
        before = known(result)
        try:
            observed = observe(result)
        except ValueError as error:
            return attrs.evolve(before, notes=(f"not verified: {error}",))
        stats, duration = result.stats, result.final_state.t - start.t
        methods = self._methods(stats.method, stats.steps, duration)
        begun = self._begun.get(methods[0])
        before_meshes = self._time(methods, start) if begun is None or begun.cancel() else None
        meshes = {ratio: self._result(ratio, self._on_mesh, ratio) for ratio in (FINE, COARSE)}
        in_time = before_meshes or self._time(methods, start)
        notes = [one.message for one in (in_time, *meshes.values()) if one.value is None]
        checks = tuple(one.value for one in (in_time, meshes[COARSE], meshes[FINE]))
        until = _until(result, observed, in_time.value, PARTED * max(self._rtol, PARTED_RTOL))
        errors = self._errors(observed, checks, until, before)
        complete = all(one.total is not None for one in errors if one.quantity not in HISTORIES)
        complete &= until is not None or all(one.total is not None for one in errors)
        return attrs.evolve(
            before,
            verified=complete,
            errors=errors,
            until=until,
            runs=tuple(f"{check.name}, {check.cpu:.2g} s CPU" for check in checks if check),
            notes=tuple(dict.fromkeys(notes)),
        )

    def _errors(
        self,
        observed: Observed,
        checks: tuple[Done | None, ...],  # of the integration, the coarser mesh, the finer one
        until: float | None,
        before: Accuracy,
    ) -> tuple[QuantityError, ...]:
        judged = math.inf if until is None else until
        known_part = judged - observed.t[0] >= JUDGED * (observed.t[-1] - observed.t[0])
        in_time = differences(observed, checks[0].seen, judged) if checks[0] else {}
        of_contact = self._of_contact(observed)
        coarse, fine = (
            (self._finer(self._links(ratio)), check.seen) if check else None
            for ratio, check in zip((COARSE, FINE), checks[1:], strict=True)
        )
        errors = []
        for quantity in QUANTITIES:
            time = None if in_time else before[quantity].time
            space, order = before[quantity].space, None
            if known_part or quantity not in HISTORIES:
                if quantity in in_time:
                    least = CHANCE * in_time["tension"] if quantity not in HISTORIES else 0.0
                    time = _finite(max(TIME_FLOOR, in_time[quantity], least))
                if coarse or fine:
                    found, order = space_error(quantity, observed, coarse, fine, judged)
                    space = None if found is None else _finite(max(SPACE_FLOOR, found))
            errors.append(
                QuantityError(
                    quantity=quantity,
                    time=time,
                    space=space,
                    order=order,
                    compliance=of_contact[quantity],
                )
            )
        return tuple(errors)

    def _of_contact(self, observed: Observed) -> dict[str, float]:
        """Return the effect of the compliance of the contact, under the load of the last part."""
        tension = observed.span_mean
        if not (np.isfinite(tension).all() and tension.min() >= 0.0 and tension.max() > 0.0):
            return compliance_error(self._params)
        rims = observed.speed[-1] * self._params._rolling
        along = rims[np.argmax(np.abs(rims))]
        return compliance_error(self._params, tension, float(along))

    # --- the runs ---

    def _time(self, methods: Sequence[str], start: State) -> Outcome:
        """Return the error in time by a tighter integration on the same mesh, first to finish."""
        for method in methods:
            check = self._result(method, self._check_time, method, start)
            if check.value is not None:
                return check
        return attrs.evolve(check, message=f"error in time not verified: {check.message}")

    def _explicit_steps(self, duration: float) -> float:
        """Return the number of steps that "tsit5" takes where stability limits them."""
        return duration * self._params.info["spectral_bound"] / STABLE

    def _methods(self, used: str, steps: float, duration: float) -> list[str]:
        """Return the methods that can check a run, which took so many steps, the best first."""
        affordable = AFFORDABLE * self._params._belt_facts["implicit_cost"] * steps
        if used == "tsit5" or self._explicit_steps(duration) > affordable:
            return ["rodas4"]
        return ["tsit5", "rodas4"]

    def _check_time(self, method: str, start: State) -> Outcome:
        """Integrate the same mesh again, to a tighter tolerance."""
        rtol = max(1e-12, TIGHTER * (self._rtol if self._step is None else min(self._rtol, 1e-4)))
        # Friction or contact may be stiffer than the joints: explicit steps then go nowhere.
        steps = self._explicit_steps(self._scene.t_end - start.t)
        return self._checked(
            f"{method} at rtol = {rtol:.2g} on the same mesh",
            self._params,
            start,
            method=method,
            rtol=rtol,
            max_steps=math.ceil(3.0 * steps) + 1000 if method == "tsit5" else None,
        )

    def _links(self, ratio: float) -> int:
        return max(3, round(ratio * self._params.n_bodies))

    def _finer(self, n_bodies: int) -> float:
        """Return the refinement of a mesh of so many links; of cells, by those on pulleys."""
        own, flows = self._params, self._params._flows
        spans = len(own.pulleys) if flows else 0
        if flows:
            n_bodies = with_links(own, n_bodies).n_bodies
        return (n_bodies - spans) / (own.n_bodies - spans)

    def _result(self, what: float | str, do: Callable[..., Outcome], *of: Any) -> Outcome:
        """Return the outcome of a run, done here unless the other thread has begun it."""
        future = self._begun.get(what)
        return do(*of) if future is None or future.cancel() else future.result()

    def _on_mesh(self, ratio: float) -> Outcome:
        n_bodies, own = self._links(ratio), self._params.n_bodies
        nodes = self._params._belt_facts["nodes"]
        if n_bodies > _core.MAX_LINKS or self._finer(n_bodies) == 1.0:
            return Outcome(
                status="refused", message=f"no mesh of {ratio:g} times the {nodes} was tried"
            )
        method, rtol, step = self._method, max(self._rtol, MESH_RTOL), self._step
        if ratio < 1.0 and step is None and method in ("auto", "tsit5"):
            method = "rodas4"  # unrelated to most of the run
        if step is not None and method == "rk4":
            step *= own / n_bodies  # as its stability asks
        fixed = step if method in ("rk4", "lbdf2", "lie") else None
        name = f"{n_bodies} {nodes} with {method}" + ("" if fixed else f" at rtol = {rtol:.2g}")

        def begin() -> tuple[Params, State | None]:
            params = with_links(self._params, n_bodies)
            if self._initial is None:
                return params, None
            return params, _as_settled(self._initial, self._params, params, self._settle)

        begun = attempt(begin)
        if begun.value is None:
            return attrs.evolve(begun, message=f"{name}: {begun.message}")
        params, start = begun.value
        if start is None and self._initial is not None:
            return Outcome(
                status="refused",
                message=f"error of the mesh not verified: the initial state is given on {own} "
                f"{nodes}, and is not one of settle(params, ...) or its at_speed(...)",
            )
        return self._checked(name, params, start, method=method, rtol=rtol, step=fixed)

    def _checked(self, name: str, params: Params, start: State | None, **options: Any) -> Outcome:
        """Run; errors, also of a user's function, are an outcome: the main result is kept."""
        found = attempt(lambda: attrs.evolve(self._runs.on(params, start, **options), name=name))
        return found if found.value else attrs.evolve(found, message=f"{name}: {found.message}")


def _as_settled(initial: State, params: Params, other: Params, settle: Settle) -> State | None:
    """Return the state on another mesh, if it is one that settling gives there as well."""
    # Links have positions of their own, to within the depth of the contact; a state that is moved
    # to other links would begin with a shock.
    initial = initial._with_waves(params)
    still = not any(getattr(initial, name).any() for name in SPEEDS)
    speeds = {0: float(initial.omega[0])}
    ways: tuple[Callable[[Params], State], ...] = (
        lambda drive: settle(drive, speed=speeds),
        lambda drive: settle(drive).at_speed(drive, speeds),
    )
    for way in (settle,) if still else ways:
        if _same(initial, way(params), params.info["link_length"]):
            return attrs.evolve(way(other), t=initial.t, theta=initial.theta)
    return None


def _same(one: State, other: State, scale: float) -> bool:
    """Return whether links stand and move alike, positions to 1e-9 of a scale [m]."""
    places = ["x", "y", "phi", "m", "a", "along", "mu", "slip"]
    if one.mu.shape != other.mu.shape:  # states of laws with other numbers of them
        if one.mu.any() or other.mu.any():
            return False
        places.remove("mu")
    return all(
        np.allclose(getattr(one, name), getattr(other, name), rtol=1e-9, atol=1e-9 * scale)
        for name in places
    ) and all(np.allclose(getattr(one, name), getattr(other, name)) for name in SPEEDS)


def _until(result: Result, observed: Observed, in_time: Done | None, limit: float) -> float | None:
    """Return the time from which histories diverge, by either run or by their difference."""
    times = [apart_from(result)]
    if in_time is not None:
        times += [in_time.apart_from, _parting(observed, in_time.seen, limit)]
    return min((t for t in times if t is not None), default=None)


def _parting(a: Observed, b: Observed, limit: float) -> float | None:
    """Return the last time at which tensions differ by a tenth of a limit exceeded later."""
    # The limit, over the mean tension, is far beyond the error of the tolerance.
    apart = np.sqrt(np.mean((a.tension - b.tension) ** 2, axis=1))
    beyond = np.flatnonzero(apart > limit * b.scales["tension"])
    if beyond.size == 0:
        return None
    close = np.flatnonzero(apart[: beyond[0]] <= 0.1 * limit * b.scales["tension"])
    return float(b.t[close[-1] if close.size else 0])


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None
