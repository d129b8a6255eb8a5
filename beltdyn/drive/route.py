"""The way of the belt round its pulleys, from their centres, radii and sides alone."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress

import attrs
import numpy as np

from .. import _core
from ..base.checks import Array
from ..base.naming import label, names_of
from .parts import Pulley, as_pulleys


@attrs.frozen(kw_only=True, eq=False)
class Route:
    """The tight belt line: spans that touch the pulleys, and the arcs on which the belt lies.

    Pulleys and spans are counted as the belt visits them; span k follows pulley k.

    Attributes:
        arrive: Points at which the belt meets each pulley (n_p, 2) [m].
        leave: Points at which it leaves (n_p, 2) [m].
        wraps: Wrap angles (n_p,) [rad], > 0.
        spans: Lengths of the free spans (n_p,) [m].
        senses: Sense in which the belt runs round each pulley, in the order of its numbering
            (n_p,): +1 counter-clockwise, -1 clockwise. A pulley whose rim goes with the belt at the
            speed v has the angular velocity ``sense v / radius``.
        length: Length of the whole line [m]. A belt is shorter by its strain.
        turns: Turns of the belt round its own loop: -1 clockwise, +1 counter-clockwise, 0 crossed.
        names: The names of the pulleys, "pulley 3" if it has none (n_p).
    """

    arrive: Array
    leave: Array
    wraps: Array
    spans: Array
    senses: Array
    length: float
    turns: int
    names: tuple[str, ...]

    @property
    def _ways(self) -> Array:
        """Spans from where the belt leaves to where it arrives (n_p, 2) [m]."""
        return np.roll(self.arrive, -1, axis=0) - self.leave

    def __str__(self) -> str:
        crossed = ", crossed" if self.turns == 0 else ""
        rows = [
            f"Belt line of {self.length:.6g} m{crossed}; turning in the order of its numbering:"
        ]
        for k, (wrap, span) in enumerate(zip(self.wraps, self.spans, strict=True)):
            sense = "counter-clockwise" if self.senses[k] > 0 else "clockwise"
            rows.append(
                f"  {label(k, self.names)}: wrap {np.degrees(wrap):5.1f} deg, {sense}; "
                f"then a span of {1e3 * span:.1f} mm"
            )
        return "\n".join(rows)


def route(pulleys: Iterable[Pulley]) -> Route:
    """Find the route of a belt round pulleys, before any belt is chosen.

    Args:
        pulleys: The pulleys in the order in which the belt visits them, each with its side; those
            on mounts in the places given.

    Raises:
        TypeError: These are no pulleys.
        ValueError: There is no such route: pulleys overlap, one is passed by, a span would pass
            through one, or the belt would cross itself.
    """
    given = as_pulleys(pulleys)
    return route_at(given, np.array([pulley.center for pulley in given], dtype=float))


def _passed_by(given: tuple[Pulley, ...], centers: Array) -> str:
    """Name the pulley without which there would be a route, if there is just one."""
    alone = []
    for k in range(1, len(given)):
        rest = [j for j in range(len(given)) if j != k]
        with suppress(ValueError):
            _core.belt_line(
                centers[rest],
                [given[j].radius for j in rest],
                [given[j].side == "outside" for j in rest],
            )
            alone.append(k)
    if len(alone) != 1 or len(given) < 3:
        return ""
    name = label(alone[0], names_of(pulley.name for pulley in given))
    side = given[alone[0]].side
    return (
        f"; the other pulleys have a belt line: does {name}, {side} the loop, touch the belt where "
        "it is, or is it on the other side?"
    )


def route_at(given: tuple[Pulley, ...], centers: Array) -> Route:
    """Find the route of a belt round pulleys whose axes are at ``centers`` (n_p, 2) [m]."""
    radii = np.array([pulley.radius for pulley in given], dtype=float)
    outside = [pulley.side == "outside" for pulley in given]
    names = [pulley.name for pulley in given]
    try:
        rows, length, turns = _core.belt_line(centers, radii, outside, names)
    except ValueError as error:
        # Where one is not reached, the core names the one at which it shows.
        hint = _passed_by(given, centers) if "cannot be reached" in str(error) else ""
        raise ValueError(f"{error}{hint}") from None
    arrive, wraps, spans, senses = np.array(rows).T

    def on_rims(angle: Array) -> Array:
        along = np.column_stack([np.cos(angle), np.sin(angle)])
        return np.asarray(centers + radii[:, None] * along)

    return Route(
        arrive=on_rims(arrive),
        leave=on_rims(arrive + senses * wraps),
        wraps=wraps,
        spans=spans,
        senses=senses,
        length=length,
        turns=turns,
        names=names_of(names),
    )
