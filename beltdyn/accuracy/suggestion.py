"""The cheapest setting for an error."""

from __future__ import annotations

import textwrap
from typing import Any

import attrs

from ..base.checks import positive
from ..base.described import suggesting
from ..base.rounding import percent
from ..drive import cells
from ..drive.compliance import compliance_error
from ..drive.params import Params
from ..drive.scene import Scene
from ..outputs.accuracy_report import Expected
from ..result.errors import SimulationError
from ..run.settling import settle
from ..run.simulation import simulate
from ..verification.forecast import Forecast, Pilot
from ..verification.quantities import with_links
from ..verification.runs import Runs, Setting, whole_scene
from .study_table import quantity_of

#: CPU time of a run of links [s] from which on an ALE belt is tried.
MIN_CPU_TIME = 0.5


@attrs.frozen(kw_only=True, repr=False)
class Suggestion:
    """A setting for an error that was asked for, and what to expect of it.

    Use it as ``simulate(*suggestion.scene, **suggestion.options)``; ``print(suggestion)`` explains
    it.

    Attributes:
        scene: The scene, with the number of links or cells suggested.
        method: Integration method.
        rtol: Its tolerance.
        seconds: CPU time of the run, without settling [s].
        asked: The error asked for [1].
        quantity: Quantity whose error it is, one of ``bd.accuracy.QUANTITIES``.
        error: The error expected [1], the sum of the next two.
        error_space: That of the mesh [1].
        error_time: That of the integration in time [1].
        error_contact: Effect of the compliance of the contact, against rigid pulleys [1]: the same
            with any setting and not part of ``error``; see ``params.compliance``.
        met: Whether ``error`` is within ``asked``; if not, this is the most accurate setting known.
        pilot_seconds: CPU time of the runs from which this is known, with settling [s].
        pilot_runs: Number of these runs.
        ale: CPU time of a run of the same scene with an ALE belt [s], and how far it is from the
            pilot run on the finest mesh [1]; None: there is none, or links do not take much longer.
    """

    scene: Scene
    method: str
    rtol: float
    seconds: float
    asked: float
    quantity: str
    error: float
    error_space: float
    error_time: float
    error_contact: float
    met: bool
    pilot_seconds: float
    pilot_runs: int
    ale: tuple[float, float] | None = None

    @property
    def params(self) -> Params:
        """The drive with the number of links or cells suggested."""
        return self.scene.params

    @property
    def n_bodies(self) -> int:
        """Number of links; of an ALE belt that of cells."""
        return self.scene.params.n_bodies

    @property
    def options(self) -> dict[str, Any]:
        """Keywords for :func:`beltdyn.simulate`: ``method``, ``rtol`` and ``expected``.

        ``expected`` puts the errors expected here into ``result.accuracy``. They do not hold for
        other drives, as in a sweep: use ``setting.options`` there.
        """
        expected = Expected(quantity=self.quantity, space=self.error_space, time=self.error_time)
        return {**self.setting.options, "expected": expected}

    @property
    def setting(self) -> Setting:
        """``n_bodies``, method and tolerance together."""
        return Setting(self.n_bodies, self.method, self.rtol)

    def __str__(self) -> str:
        asked = f"error of {percent(self.asked)} of {self.quantity.replace('_', ' ')}"
        how = (
            f'method "{self.method}", rtol {self.rtol:.2g}, {self.n_bodies} '
            f"{self.params._belt_facts['nodes']}; about {self.seconds:.2g} s of CPU time"
        )
        error = (
            f"{percent(self.error)} ({percent(self.error_space)} of the mesh, "
            f"{percent(self.error_time)} of time)"
        )
        text = f"For an {asked}: {how}, expected error {error}. "
        if not self.met:
            text = (
                f"An {asked} cannot be promised: the best found is {error}, "
                f"{self.error / self.asked:.2g} times as much, with {how}. "
            )
        if self.error_contact > 0.5 * self.asked:
            text += (
                "Not counted, but in the sum that a result tells: contact that yields changes "
                f"{percent(self.error_contact)} against rigid pulleys, whatever the setting; "
                "stiffer contact or compensate=True takes that away. "
            )
        if self.ale is not None:
            text += (
                f'With Belt(mesh="ale") the scene took {self.ale[0]:.2g} s, '
                f"{percent(self.ale[1])} from the finest pilot run. "
            )
        text += f"Known from {self.pilot_runs} pilot runs of {self.pilot_seconds:.2g} s together."
        return textwrap.fill(text, 88)

    def __repr__(self) -> str:
        return f"Suggestion({self.setting}, {self.seconds:.3g} s, error {self.error:.2g})"


@suggesting
def suggest(
    scene: Scene, error: float = 1e-2, quantity: str = "tension", *, limit: float = 30.0
) -> Suggestion:
    """Find the cheapest method, tolerance and number of links or cells for an error.

    From runs on coarse meshes: their error in space is extrapolated by its order, their error in
    time measured against tighter tolerances. They cover the whole time of the scene, since what
    happens late in it may cost the most, so together they take several times as long as the run
    that is suggested, which pays off where more runs of the kind follow. The error is relative to
    the scales of :class:`beltdyn.accuracy.Observed`. A mesh whose error jumps with the number of
    links may be further off than its neighbours suggest. Where histories depend on every detail,
    such as the creep of a drive whose links chatter, small errors cannot be had at any price;
    :attr:`Suggestion.met` is then False. Where links take long the scene is also run with an ALE
    belt, which is reported if it takes a tenth of the time (:attr:`Suggestion.ale`).

    Args:
        scene: The scene, as in :mod:`beltdyn.scenes`; of its mesh only the number of links changes.
        error: The error asked for [1], 0.01: one percent; at least 1e-6, below 1.
        quantity: Quantity whose error it is, one of ``bd.accuracy.QUANTITIES``.
        limit: CPU time after which no further pilot run begins [s].

    Raises:
        TypeError, ValueError: An argument breaks its rule.
        SimulationError: The scene could not be run on any mesh.
        Interrupted: Ctrl-C.
    """
    scene = whole_scene(scene)
    asked, quantity = positive("error", error), quantity_of(quantity)
    if not 1e-6 <= asked < 1.0:
        raise ValueError(f"error must be >= 1e-6 and < 1 (0.01: 1 %), got {asked:g}")
    pilot = Pilot(
        Runs(scene, simulate, settle), scene.params, quantity, limit=positive("limit", limit, "s")
    )
    return chosen(pilot, scene, asked, quantity)


def chosen(pilot: Pilot, scene: Scene, asked: float, quantity: str) -> Suggestion:
    """Return the suggestion that follows from a pilot."""
    pilot.explore(asked)
    found = pilot.cheapest(asked)
    one = found or pilot.best()
    assert one is not None  # the tight run at least is known
    return Suggestion(
        scene=scene._replace(params=with_links(scene.params, one.setting.n_bodies)),
        method=one.setting.method,
        rtol=one.setting.rtol,
        seconds=one.seconds,
        asked=asked,
        quantity=quantity,
        error=one.error,
        error_space=one.space,
        error_time=one.time,
        error_contact=compliance_error(scene.params)[quantity],
        met=found is not None,
        pilot_seconds=pilot.spent,
        pilot_runs=pilot.runs,
        ale=_flowing(one, pilot, scene),
    )


def _flowing(one: Forecast, pilot: Pilot, scene: Scene) -> tuple[float, float] | None:
    """Run the scene with an ALE belt, if links take long: CPU time and error, if it is cheaper."""
    other = cells.instead(scene.params)
    if other is None or one.seconds < MIN_CPU_TIME:
        return None
    runs = Runs(scene._replace(params=other), simulate, settle)
    try:
        done = runs(Setting(other.n_bodies, "auto", min(one.setting.rtol, cells.AT)))
    except SimulationError:
        return None
    return (done.cpu, pilot.off(done.seen)) if one.seconds > cells.CHEAPER * done.cpu else None
