"""A hard scene: a scene, what it provokes, and what must hold in spite of that."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs

from ...drive.parts import BELTS
from ...drive.scene import Scene
from ...outputs.state import State
from ...result.result import Result
from ...run.simulation import simulate


class HardScene(Scene):
    """A scene made to break an integrator, as ``bd.scenes.hard`` has them.

    It is a :class:`Scene`, so ``simulate(*scene)`` runs its drive; :meth:`run` also begins where
    the scene begins, and with its options.

    Attributes:
        name: Its name; ``hard/NAME`` on the command line and for ``bd.scenes.find``.
        family: What kind of thing is hard.
        provokes: What goes wrong in an integrator that is not made for it.
        holds: What must hold nevertheless: an invariant, a theory.
        options: Options of :func:`beltdyn.simulate` that belong to the scene, beside the method.
        expects: Symbol of the error in which the run must end (:class:`beltdyn.SimulationError`),
            where that is the right outcome; None: it must finish.
    """

    name: str
    family: str
    provokes: str
    holds: str
    options: dict[str, Any]
    expects: str | None
    _start: Callable[[HardScene], State] | None
    _theory: Callable[[HardScene, Result], float] | None

    def _replace(self, **changes: Any) -> HardScene:
        """Return a copy with fields of the scene changed; all else stays."""
        copy = type(self)(**{**self._asdict(), **changes})
        vars(copy).update(vars(self))
        return copy

    def initial(self) -> State | None:
        """Return the state in which the run starts; None: settled at rest, as ``simulate`` does.

        Raises:
            SimulationError: The belt does not settle.
        """
        return None if self._start is None else self._start(self)

    @property
    def starts(self) -> bool:
        """Whether it starts in a state of its own."""
        return self._start is not None

    @property
    def told(self) -> str:
        """What it provokes, and what must hold, in two lines."""
        return f"provokes {self.provokes}\nholds    {self.holds}"

    def deviation(self, result: Result) -> float | None:
        """Return the deviation of a finished run from theory, over what :attr:`holds` allows.

        It may take further runs of the drive.

        Args:
            result: A run of this scene, by any method.

        Returns:
            At most 1 where theory is kept; None: there is none for this scene.
        """
        return None if self._theory is None else self._theory(self, result)

    def with_belt(self, model: str) -> HardScene | None:
        """Return the same drive with its belt made of something else.

        Args:
            model: "joint", links that meet the pulleys along their length; "string", point masses
                without bending; "paper", links that meet them at their centres.

        Returns:
            The scene; None where there cannot be one: a belt with bending stiffness is no string,
            pulleys on mounts need the mesh of joints.

        Raises:
            ValueError: ``model`` is none of these.
        """
        if model not in BELTS:
            raise ValueError(f"model must be one of {', '.join(BELTS)}, got {model!r}")
        belt = self.params.belt
        stiff = belt.bending_stiffness > 0.0 or belt.bending_damping > 0.0
        row = BELTS[model]
        if (stiff and not row["bends"]) or (self.params.mounted and not row["mounts"]):
            return None
        belt = attrs.evolve(belt, mesh=row["mesh"], model=row["model"])
        return self._replace(params=attrs.evolve(self.params, belt=belt))

    def run(self, method: str = "auto", **options: Any) -> Result:
        """Run it from where it begins; ``options`` of ``simulate`` come before its own.

        Raises:
            SimulationError: The run ends early, which :attr:`expects` may call for.
        """
        given = {"initial": self.initial(), "method": method, **self.options, **options}
        return simulate(*self, **given)
