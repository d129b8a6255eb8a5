"""Whether `bd.accuracy.suggest` keeps its word: the cost it predicts, the cost of what it chooses.

    python benchmarks/suggest.py [--quick] [--write]

For each scene of the library, of which those that are not of the paper on the mesh "joint", and for
errors of tension of 3 %, 1 % and 0.3 %: the CPU time of the setting that is suggested over the one
predicted, over that of the cheapest setting that a study finds for the same error, and the error
that it really has. Studies are kept in build/suggest/ and not repeated, so that this may be stopped
and continued. Required: the time predicted right within a factor of 2 in 90 % of all rows, and the
setting suggested at most 1.5 times as costly as the cheapest of the study.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import common

import beltdyn as bd
from beltdyn.accuracy import differences, observe

# What a coarse or loose run warns of is known here: it is what is measured.
warnings.simplefilter("ignore", bd.BeltdynWarning)

ERRORS = (3e-2, 1e-2, 3e-3)
QUANTITY = "tension"
STORE = common.HERE.parent / "build" / "suggest"
#: Of a mesh that the study does not have but the suggestion does, CPU times are this much apart by
#: chance: the least of so many runs counts.
REPEATS = 5


@dataclass(frozen=True)
class Outcome:
    scene: str
    asked: float
    suggestion: bd.accuracy.Suggestion
    seconds: float  # CPU time of the setting suggested, the least of the repeats
    error: float  # its error against the reference of the study
    floor: float
    cheapest: bd.accuracy.Row | None

    @property
    def predicted(self) -> float:
        return self.seconds / self.suggestion.seconds

    @property
    def excess(self) -> float | None:
        return None if self.cheapest is None else self.seconds / self.cheapest.seconds


def scenes(quick: bool) -> list[tuple[str, bd.Scene]]:
    found = []
    for name in bd.scenes.names():
        scene = bd.scenes.get(name)
        if not name.startswith("kubas"):
            scene = common.with_belt(scene, mesh="joint")
        if quick:
            scene = scene._replace(t_end=0.1 * scene.t_end)
        found.append((name, scene))
    return found


def measure(name: str, scene: bd.Scene, quick: bool) -> list[Outcome]:
    STORE.mkdir(parents=True, exist_ok=True)
    scene, options = bd.accuracy.quick(scene) if quick else (scene, {})
    study = bd.accuracy.study(
        scene, store=STORE / f"{name}{'-quick' if quick else ''}.jsonl", progress=True, **options
    )
    fine = scene._replace(params=bd.accuracy.with_links(scene.params, study.finest))
    exact = observe(bd.simulate(*fine, method="rodas4", rtol=1e-4))
    outcomes = []
    for asked in ERRORS[:2] if quick else ERRORS:
        suggestion = bd.accuracy.suggest(scene, asked, QUANTITY)
        runs = [
            bd.simulate(*suggestion.scene, **suggestion.setting.options) for _ in range(REPEATS)
        ]
        outcomes.append(
            Outcome(
                name,
                asked,
                suggestion,
                min(run.stats.cpu_time for run in runs),
                differences(observe(runs[0]), exact)[QUANTITY],
                study.space_floor[QUANTITY],
                study.cheapest(asked, QUANTITY),
            )
        )
    return outcomes


def line(one: Outcome) -> str:
    setting, excess = one.suggestion.setting, one.excess
    chosen = f"{setting.method} {setting.rtol:.0e} {setting.n_bodies:d}"
    best = one.cheapest.setting if one.cheapest else None
    found = f"{best.method} {best.rtol:.0e} {best.n_bodies:d}" if best else "none of the study"
    return (
        f"{one.scene:16s} {one.asked:6.0e}  {chosen:18s} {one.suggestion.seconds:9.3f}"
        f" {one.seconds:9.3f} {one.predicted:6.2f}  {one.suggestion.error:8.1e} {one.error:8.1e}"
        f" {one.floor:8.1e} {'yes' if one.suggestion.met else 'no':>4s}"
        f" {one.suggestion.pilot_seconds:7.2f}  {found:18s}"
        f" {'-' if excess is None else f'{excess:.2f}':>6s}"
    )


def summary(outcomes: list[Outcome]) -> list[str]:
    within = [0.5 <= one.predicted <= 2.0 for one in outcomes]
    excess = [one.excess for one in outcomes if one.excess is not None]
    # Where the floor is above the error asked for, nobody knows the true error.
    known = [one for one in outcomes if one.floor < one.asked and one.suggestion.met]
    kept = [one.error <= one.asked for one in known]
    return [
        f"time predicted within a factor of 2: {sum(within)} of {len(within)} "
        f"(required: 90 %); largest deviation "
        f"{max(max(one.predicted, 1.0 / one.predicted) for one in outcomes):.2f}",
        f"at most 1.5 times the cheapest of the study: {sum(x <= 1.5 for x in excess)} of "
        f"{len(excess)}, the most {max(excess, default=0.0):.2f}",
        f"error within the one asked for: {sum(kept)} of {len(kept)}, the most "
        f"{max((one.error / one.asked for one in known), default=0.0):.2f} times it",
    ]


def main() -> None:
    arguments = common.arguments(__doc__, "20 minutes, and seconds with the studies kept", "2 min")
    outcomes: list[Outcome] = []
    for name, scene in scenes(arguments.quick):
        common.progress(name)
        outcomes += measure(name, scene, arguments.quick)
    lines = [
        "Suggested settings: cost predicted and real, against the cheapest of a study",
        *common.machine(),
        "",
        "scene             error  suggested          predicted      CPU s  ratio  "
        "expected     real    floor  met   pilot  cheapest           excess",
        *map(line, outcomes),
        "",
        *summary(outcomes),
    ]
    common.publish("suggest", lines, arguments.write)


if __name__ == "__main__":
    main()
