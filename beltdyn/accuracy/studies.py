"""The price of accuracy: error and CPU time of a scene by method, tolerance and mesh."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from typing import Any

import attrs

from .. import _core
from ..base.checks import flag, integer, positive, real
from ..base.described import suggesting
from ..drive.scene import Scene
from ..many.collect import outcomes
from ..many.content import Contents, needing_keys
from ..many.dispatch import Run
from ..many.outcome import Outcome, attempt
from ..many.pools import as_pool
from ..result.errors import SimulationError
from ..run.settling import settle
from ..run.simulation import simulate
from ..verification.quantities import QUANTITIES, Observed, differences, with_links
from ..verification.runs import Runs, Setting, evaluated_in_core, fewest, whole_scene
from .study_table import Row, Study

#: Methods that control their error and are worth a choice ("lie" and "rk4" are for comparison).
METHODS = tuple(name for name in _core.METHODS if name in ("auto", "tsit5", "rodas4", "lbdf2"))
#: Tolerances, from loose to tight; values above 0.1 loosen nothing further.
RTOLS = (1e-1, 3e-2, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6)
#: Numbers of links, as multiples of those of the scene.
_SHARES = (0.25, 0.5, 1.0, 2.0, 4.0)
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
_Outcomes = dict[Setting, Outcome]
#: What is measured of a run that failed.
_FAILED: dict[str, Any] = {
    "seconds": math.nan,
    "repeats": 0,
    "steps": 0,
    "error": {},
    "time": {},
}


@suggesting
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
    n_b, least = scene.params.n_bodies, fewest(scene.params)
    usual = [n for n in (round(share * n_b) for share in _SHARES) if n >= least]
    given = usual if n_bodies is None else n_bodies
    ladder = sorted({integer("n_bodies", n, 3) for n in given})
    tolerances = sorted({positive("rtols", rtol) for rtol in rtols}, reverse=True)
    for name, values in (("n_bodies", ladder), ("rtols", tolerances)):
        if not values:
            raise ValueError(f"{name} must hold at least one number")
    last = real("last", last)
    contents = None
    if store is not None:  # CPU times are those of an instruction level
        with needing_keys():
            contents = Contents(scene, {}, (), f"study {last} {_core.kernel_level()}")
    workers = workers if workers is None else integer("workers", workers, 1)
    shown = flag("progress", progress)
    names = _names(scene, methods)
    finest = 2 * ladder[-1] if finest is None else integer("finest", finest, ladder[-1] + 1)
    limit = positive("limit", limit, "s")
    runs = Runs(scene, simulate, settle, last=last)

    def collected(what: str, do: Run, inputs: Mapping[Setting, Any], **others: Any) -> _Outcomes:
        """Do runs at settings; of each what it depends on besides the scene is given."""
        found = outcomes(
            do,
            list(inputs),
            lambda: as_pool(workers),
            str,
            store=store,
            keys=[contents.key((), json.dumps(one)) for one in inputs.values()] if contents else [],
            progress=shown,
            label=f"accuracy, {what}",
            **others,
        )
        return dict(zip(inputs, found, strict=True))

    def refer(setting: Setting, _before: None) -> Outcome:
        return Outcome(status="finished", value=attrs.asdict(runs(setting).seen))

    def climb(setting: Setting, before: float | None) -> Outcome:
        """Run a setting, unless the looser one before it, of so much CPU time, took too long."""
        if before is not None and before > limit:
            return Outcome(status="missing", final=before)
        own = {pair.method: seen[pair] for pair in pairs[setting.n_bodies]}
        outcome = attempt(
            lambda: _compared(runs, setting, own, first[finest], limit), SimulationError
        )
        seconds = (outcome.value or _FAILED)["seconds"]
        return attrs.evolve(outcome, final=seconds)

    # The longest first, so that no thread is left with them at the end.
    pairs = {
        n: _references(scene, n, finest, tolerances[-1], limit) for n in (finest, *ladder[::-1])
    }
    wanted = {one: ["reference", attrs.astuple(one)] for pair in pairs.values() for one in pair}
    referred = collected("references", refer, wanted)
    seen = {one: Observed(**outcome.value) for one, outcome in referred.items()}
    first, second = ({n: seen[pair[k]] for n, pair in pairs.items()} for k in (0, 1))
    settings = {n: [Setting(n, m, r) for m in names for r in tolerances] for n in ladder}
    wanted = {
        one: [attrs.astuple(of) for of in (one, *pairs[n], *pairs[finest])]
        for n in reversed(ladder)
        for one in settings[n]
    }
    after = [k - 1 if k % len(tolerances) else -1 for k in range(len(wanted))]
    climbed = collected("runs", climb, wanted, after=after)
    space = {n: differences(first[n], first[finest]) for n in ladder}
    floors = {n: differences(second[n], first[n]) for n in pairs}
    fall = (finest / ladder[-1]) ** _ORDER - 1.0
    left = {name: error / fall for name, error in space[ladder[-1]].items()}
    nodes = scene.params._belt_facts["nodes"]
    return Study(
        rows=tuple(
            Row(setting=one, **(climbed[one].value or _FAILED), failure=climbed[one].message)
            for n in ladder
            for one in settings[n]
            if climbed[one].status != "missing"
        ),
        space=space,
        time_floor={n: floors[n] for n in ladder},
        space_floor={name: max(floors[finest][name], left[name]) for name in QUANTITIES},
        finest=finest,
        references=tuple(
            f"{n} {nodes}: {' and '.join(f'{one.method} at rtol {one.rtol:g}' for one in pair)}"
            for n, pair in sorted(pairs.items())
        ),
        mesh=scene.params.belt.mesh,
        nodes=nodes,
        n_bodies=scene.params.n_bodies,
    )


def quick(scene: Scene) -> tuple[Scene, dict[str, Any]]:
    """Return a scene and keywords for a short :func:`study`: a first impression.

    It has half the links of the scene and, unless that takes long, all of them, tolerances from 0.1
    to 0.001, and only the beginning of a run that takes long: some 15 s of CPU time in all,
    estimated from one run.

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


def _names(scene: Scene, methods: Sequence[str] | None) -> list[str]:
    if methods is None:
        return [name for name in METHODS if name != "tsit5" or not _flows(scene)]
    if isinstance(methods, str) or not methods:
        raise TypeError(f"methods must be a sequence of names, got {methods!r}")
    for name in methods:
        if name not in METHODS:
            raise ValueError(f"methods must be of {', '.join(METHODS)}, got {name!r}")
    return list(dict.fromkeys(methods))


def _flows(scene: Scene) -> bool:
    return scene.params._flows


def _references(
    scene: Scene, n_bodies: int, finest: int, least: float, limit: float
) -> list[Setting]:
    """Return two settings on a mesh whose runs those of this tolerance are compared to."""
    flows, pairs = _flows(scene), _FINE
    if n_bodies != finest:
        bound = with_links(scene.params, n_bodies).info["spectral_bound"]
        explicit = scene.t_end * bound / _EXPLICIT_STEP * _EXPLICIT_COST * n_bodies
        pairs = _TIGHT[1:] if flows or explicit > _LONGEST * limit else _TIGHT[:2]
    scale = _ON_CELLS if flows else 1.0
    return [
        Setting(n_bodies, name, scale * max(share * least, floor)) for name, share, floor in pairs
    ]


def _compared(
    runs: Runs, setting: Setting, own: dict[str, Observed], fine: Observed, limit: float
) -> dict[str, Any]:
    """Run a setting; return its cost, its errors against references on its mesh and the finest."""
    times: list[float] = []
    while not times or (
        len(times) < _REPEATS and (len(times) + 1) * min(times) <= _REPEATED * limit
    ):
        done = runs(setting)
        times.append(done.cpu)
    # References by another method; "auto" may have used either.
    unrelated = [seen for method, seen in own.items() if method != setting.method]
    if setting.method != "auto":
        del unrelated[1:]
    apart = [differences(done.seen, seen) for seen in unrelated]
    return {
        "seconds": min(times),
        "repeats": len(times),
        "steps": done.steps,
        "error": differences(done.seen, fine),
        "time": {name: max(one[name] for one in apart) for name in QUANTITIES},
    }
