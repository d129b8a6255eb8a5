"""The price of accuracy: error and CPU time of a scene by method, tolerance and mesh."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array, flag, integer, positive, real
from ..drive.params import Params
from ..drive.scene import Scene
from ..many.collect import outcomes
from ..many.content import Contents, known
from ..many.outcome import Outcome, attempt
from ..many.pools import as_pool
from ..result.errors import SimulationError
from ..run.simulation import settle, simulate
from ..verification.quantities import QUANTITIES, Observed, differences, with_links
from ..verification.runs import Runs, evaluated_in_core, whole_scene
from ..verification.settings import METHODS, RTOLS, Setting, fewest, meshes
from .study_rows import Row
from .study_table import Study

__all__ = ["quick", "study"]

#: References in time, of unrelated families, explicit one-step, implicit one-step and multistep:
#: tolerances over the tightest compared, and the tightest. Of those that are affordable on a mesh
#: the first two count.
_TIGHT = (("tsit5", 1e-2, 1e-8), ("rodas4", 0.1, 1e-6), ("lbdf2", 1.0, 1e-3))
#: The same in space, on the finest mesh; what they leave is far below the errors of the meshes.
_FINE = (("rodas4", 1.0, 1e-4), ("lbdf2", 3.0, 1e-3))
#: Tolerances of references of ALE belts over these: "lbdf2" leaves five times its own there, and
#: steps are cheap. Explicit methods, which take hundreds of times as many, are left out.
_ON_CELLS = 0.01
#: Repeats of a run, as long as all take no more CPU time than this together [limits of a run].
_REPEATS, _REPEATED = 3, 0.3
#: Steps of "tsit5" over 1/(spectral bound), CPU time of one per link [s], and the longest that a
#: reference by it may take [limits of a run]. Rough numbers, for a choice of references alone.
_EXPLICIT_STEP, _EXPLICIT_COST, _LONGEST = 2.5, 8e-8, 7.5
#: CPU time of a quick study [s], and limit of its runs [s]; what it takes over a run on the coarser
#: mesh, with the finer one and without.
_QUICK, _QUICK_LIMIT, _BOTH, _ONE = 15.0, 0.2, 100.0, 40.0
#: The order of the meshes, to estimate what is left of the error in space on the finest.
_ORDER = 2.0
#: What is measured of a run that failed.
_FAILED: dict[str, Any] = {
    "seconds": math.nan,
    "repeats": 0,
    "steps": 0,
    "error": {},
    "time": {},
}


def study(
    scene: Scene,
    *,
    methods: Sequence[str] | None = None,
    rtols: Sequence[float] = RTOLS,
    n_bodies: Sequence[int] | None = None,
    finest: int | None = None,
    limit: float = 2.0,
    last: float = 0.2,
    workers: int | None = None,
    store: str | os.PathLike[str] | None = None,
    progress: bool = False,
) -> Study:
    """Measure cost and errors of each setting of a run.

    Runs the scene with each method, tolerance and number of links or cells. The error in time is
    the difference to a run on the same mesh at a tight tolerance by a method of another family; the
    error in space that of such a run to one on the finest mesh; the total error that of the run
    itself to the one on the finest mesh. Each reference is computed twice, by unrelated methods;
    their difference is the floor, below which no error is known.

    Args:
        scene: The scene, as in :mod:`beltdyn.scenes`; of its mesh only the number of links changes.
        methods: Methods to compare; None: "auto", "tsit5", "rodas4" and "lbdf2", of an ALE belt
            those that are implicit, as explicit steps cost hundreds of times as much there.
        rtols: Tolerances to compare.
        n_bodies: Numbers of links to compare; None: a quarter to four times those of the scene.
        finest: Number of links of the reference in space; None: twice the most of ``n_bodies``.
        limit: CPU time of a run [s] above which no tighter tolerance is tried with the same method
            on the same mesh.
        last: Part of the run that means are taken over.
        workers: Runs at a time; None: one for each processor, or one alone if torque or motion are
            functions, which may not be safe in several threads. The CPU time is that of the thread
            of a run, the least of up to three repeats.
        store: A folder to keep the runs in (SQLite files); those found there, of the same scene and
            build of beltdyn, are not repeated. Functions are known as in :func:`beltdyn.sweep`.
        progress: Whether to show a progress bar on stderr (needs ``rich``).

    Raises:
        TypeError, ValueError: An argument breaks its rule.
        SimulationError: A reference could not be computed.
        Interrupted: Ctrl-C; with ``store`` what is finished is kept.
        OSError: The store cannot be read or written.
    """
    scene = whole_scene(scene)
    if workers is None and not evaluated_in_core(scene):
        workers = 1
    ladder = _numbers(scene.params, n_bodies)
    last = real("last", last)
    job = _Job(
        scene=scene,
        methods=_names(_methods(scene.params) if methods is None else methods),
        rtols=sorted((positive("rtols", rtol) for rtol in rtols), reverse=True),
        meshes=ladder,
        finest=2 * ladder[-1] if finest is None else integer("finest", finest, ladder[-1] + 1),
        limit=positive("limit", limit, "s"),
        runs=Runs(scene, simulate, settle, last=last),
        workers=workers if workers is None else integer("workers", workers, 1),
        store=store,
        contents=None if store is None else _contents(scene, last),
        progress=flag("progress", progress),
    )
    return job.study()


def quick(scene: Scene) -> tuple[Scene, dict[str, Any]]:
    """Return a scene and keywords for a short :func:`study`: a first impression.

    Half the links of the scene and, unless that takes long, all of them, tolerances from 0.1 to
    0.001, and of a run that takes long the beginning, so that all takes some 15 s of CPU time. One
    run measures what runs cost.

    Raises:
        TypeError, ValueError: It is no scene that can be run.
        SimulationError: It cannot be run with half the links.
    """
    scene = whole_scene(scene)
    n_b = scene.params.n_bodies
    few = min(n_b, max(n_b // 2, fewest(scene.params)))
    cost = Runs(scene, simulate, settle)(Setting(few, "auto", 1e-2)).cpu
    numbers = [few, n_b] if cost * _BOTH <= _QUICK and few < n_b else [few]
    share = min(1.0, _QUICK / (_ONE * cost))
    options = {"n_bodies": numbers, "rtols": RTOLS[:4], "limit": _QUICK_LIMIT}
    return scene._replace(t_end=share * scene.t_end), options


def _methods(params: Params) -> list[str]:
    explicit = "tsit5" if params._belt_facts["flows"] else ""
    return [name for name in METHODS if name != explicit]


def _names(methods: Sequence[str]) -> list[str]:
    if isinstance(methods, str) or not methods:
        raise TypeError(f"methods must be a sequence of names, got {methods!r}")
    for name in methods:
        if name not in METHODS:
            raise ValueError(f"methods must be of {', '.join(METHODS)}, got {name!r}")
    return list(dict.fromkeys(methods))


def _numbers(params: Params, n_bodies: Sequence[int] | None) -> list[int]:
    given = meshes(params) if n_bodies is None else n_bodies
    numbers = sorted({integer("n_bodies", n, 3) for n in given})
    if not numbers:
        raise ValueError("n_bodies must hold at least one number")
    return numbers


def _contents(scene: Scene, last: float) -> Contents:
    """Return the keys of runs: CPU times are those of an instruction level."""
    with known():
        return Contents(scene, {}, (), f"study {last} {_core.kernel_level()}")


@attrs.define(kw_only=True, eq=False)
class _Job:
    """A study in progress."""

    scene: Scene
    methods: list[str]
    rtols: list[float]
    meshes: list[int]
    finest: int
    limit: float
    runs: Runs
    workers: int | None
    store: str | os.PathLike[str] | None
    contents: Contents | None
    progress: bool

    def study(self) -> Study:
        # The longest first, so that no thread is left with them at the end.
        wanted = [Setting(self.finest, *pair) for pair in self._references(_FINE)]
        for n_b in reversed(self.meshes):
            wanted += [Setting(n_b, *pair) for pair in self._tight(n_b)]
        what = [["reference", attrs.astuple(one)] for one in wanted]
        found = self._collect("references", self._reference, wanted, what)
        seen = {one: _from_lists(of.value) for one, of in zip(wanted, found, strict=True)}
        references = {n_b: self._pair(n_b, seen) for n_b in [*self.meshes, self.finest]}
        fine = references[self.finest]

        def against(n_b: int) -> list[Any]:
            return [attrs.astuple(one) for one, _ in (*references[n_b], *fine)]

        settings = [
            Setting(n, m, r)
            for n in reversed(self.meshes)
            for m in self.methods
            for r in self.rtols
        ]
        climbed = self._collect(
            "runs",
            lambda one, before: self._climb(one, before, references[one.n_bodies], fine[0][1]),
            settings,
            [[attrs.astuple(one), against(one.n_bodies)] for one in settings],
            after=[k - 1 if k % len(self.rtols) else -1 for k in range(len(settings))],
        )
        rows = [
            Row(setting=one, **(of.value or _FAILED), failure=of.message)
            for one, of in zip(settings, climbed, strict=True)
            if of.status != "missing"
        ]
        return self._study(rows, references)

    def _collect(
        self,
        what: str,
        run: Callable[[Setting, Array | None], Outcome],
        settings: list[Setting],
        inputs: list[Any],
        after: Sequence[int] = (),
    ) -> list[Outcome]:
        """Return the outcomes of runs; of each what it depends on besides the scene is given."""
        contents = self.contents
        return outcomes(
            run,
            settings,
            lambda: as_pool(self.workers),
            str,
            after=after,
            store=self.store,
            keys=[contents.key((), json.dumps(one)) for one in inputs] if contents else [],
            progress=self.progress,
            label=f"accuracy, {what}",
        )

    # --- references ---

    def _references(self, pairs: Sequence[tuple[str, float, float]]) -> list[tuple[str, float]]:
        least = min(self.rtols)
        scale = _ON_CELLS if self.scene.params._belt_facts["flows"] else 1.0
        return [(name, scale * max(share * least, floor)) for name, share, floor in pairs]

    def _tight(self, n_b: int) -> list[tuple[str, float]]:
        bound = with_links(self.scene.params, n_b).info["spectral_bound"]
        explicit = self.scene.t_end * bound / _EXPLICIT_STEP * _EXPLICIT_COST * n_b
        if self.scene.params._belt_facts["flows"] or explicit > _LONGEST * self.limit:
            return self._references(_TIGHT[1:])
        return self._references(_TIGHT[:2])

    def _reference(self, setting: Setting, _before: Array | None) -> Outcome:
        return Outcome(status="finished", value=_as_lists(self.runs(setting).seen))

    def _pair(self, n_b: int, seen: Mapping[Setting, Observed]) -> list[tuple[Setting, Observed]]:
        return [(one, observed) for one, observed in seen.items() if one.n_bodies == n_b]

    # --- runs ---

    def _climb(
        self,
        setting: Setting,
        before: Array | None,
        own: list[tuple[Setting, Observed]],
        fine: Observed,
    ) -> Outcome:
        """Run a setting, unless the looser one before it, of so much CPU time, took too long."""
        if before is not None and before[0] > self.limit:
            return Outcome(status="missing", final=before)
        times: list[float] = []

        def run() -> dict[str, Any]:
            while not times or (
                len(times) < _REPEATS and (len(times) + 1) * min(times) <= _REPEATED * self.limit
            ):
                done = self.runs(setting)
                times.append(done.cpu)
            apart = [differences(done.seen, seen) for seen in _unrelated(setting.method, own)]
            return {
                "seconds": min(times),
                "repeats": len(times),
                "steps": done.steps,
                "error": differences(done.seen, fine),
                "time": {name: max(one[name] for one in apart) for name in QUANTITIES},
            }

        outcome = attempt(run, SimulationError)
        seconds = (outcome.value or _FAILED)["seconds"]
        return attrs.evolve(outcome, final=np.array([seconds]))

    # --- all together ---

    def _study(
        self, rows: Sequence[Row], references: Mapping[int, list[tuple[Setting, Observed]]]
    ) -> Study:
        fine = [seen for _, seen in references[self.finest]]
        space = {n: differences(references[n][0][1], fine[0]) for n in self.meshes}
        floors = {n: differences(pair[1][1], pair[0][1]) for n, pair in sorted(references.items())}
        fall = (self.finest / self.meshes[-1]) ** _ORDER - 1.0
        left = {name: error / fall for name, error in space[self.meshes[-1]].items()}
        order = [Setting(n, m, r) for n in self.meshes for m in self.methods for r in self.rtols]
        place = {setting: k for k, setting in enumerate(order)}
        nodes = self.scene.params._belt_facts["nodes"]
        return Study(
            rows=tuple(sorted(rows, key=lambda row: place[row.setting])),
            space=space,
            time_floor={n: floors[n] for n in self.meshes},
            space_floor={name: max(floors[self.finest][name], left[name]) for name in QUANTITIES},
            finest=self.finest,
            references=tuple(
                f"{n} {nodes}: "
                + " and ".join(f"{one.method} at rtol {one.rtol:g}" for one, _ in p)
                for n, p in sorted(references.items())
            ),
            mesh=self.scene.params.belt.mesh,
            nodes=nodes,
            n_bodies=self.scene.params.n_bodies,
        )


def _unrelated(method: str, pair: Sequence[tuple[Setting, Observed]]) -> list[Observed]:
    """Return the references by another method; "auto" may have used either."""
    return [seen for one, seen in pair if one.method != method][: 2 if method == "auto" else 1]


def _as_lists(seen: Observed) -> dict[str, Any]:
    values = attrs.asdict(seen, recurse=False)
    return {
        name: value.tolist() if isinstance(value, np.ndarray) else value
        for name, value in values.items()
    }


def _from_lists(values: Mapping[str, Any]) -> Observed:
    fields: dict[str, Any] = {
        name: np.array(value, dtype=float) if isinstance(value, list) else value
        for name, value in values.items()
    }
    return Observed(**fields)
