"""Places fixed in space: histories along the belt line, and hub loads without the belt's momentum.

The belt line is that of :class:`beltdyn.Route`. Places are counted from where it leaves pulley 0,
in the sense in which the links are numbered.
"""

from __future__ import annotations

from itertools import cycle
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from ..base.checks import Array
from ..base.naming import span_names
from ..drive.params import Params
from ..drive.route import Route, route_at
from ..drive.span import Span
from .arcs import contact_points, turns
from .sampled import Sampled
from .spans import ALL, joint_points

#: Numbers of a block of samples, links times parts of the line: 16 MB to an array.
_BLOCK = 2_000_000


@attrs.frozen(eq=False, kw_only=True)
class AlongBelt:
    """A history of links in places that are fixed in space.

    Attributes:
        name: Name of the output, such as "joints.force".
        t: Sample times (n_t,) [s].
        s: Places along the belt line (n_s,) [m], from where it leaves pulley 0.
        values: Values there, interpolated linearly between the two joints or links next to each
            place (n_t, n_s).
        part: Part of the line that each place is on: the name of a pulley, of a span, "crank to
            idler" (n_s,).
        wraps: Where the line arrives at each pulley and leaves it (n_p, 2) [m]; pulley 0 is at the
            end of the line.
        length: Length of the line [m].
    """

    name: str
    t: Array
    s: Array
    values: Array
    part: NDArray[np.str_]
    wraps: Array
    length: float

    def __repr__(self) -> str:
        return f"AlongBelt({self.name}: {self.values.shape}, line of {self.length:.6g} m)"


def axes_at(params: Params, travel: Array | None) -> Array:
    """Return the axes (n, n_p, 2) [m] at every travel (n, n_m) of mounts; None: one place of each.

    Of mounts without travels it is where these rest.
    """
    travels = [None] if travel is None else travel
    return np.array([params.centers(row) for row in travels])


def routes(params: Params, travel: Array | None) -> tuple[list[Route], Array]:
    """Return belt line and axes, as :func:`axes_at`, at every travel of mounts; None: one."""
    centers = axes_at(params, travel)
    if travel is None:
        return [params.route], centers
    return [route_at(params.pulleys, one) for one in centers], centers


def line_edges(line: Route, radii: Array) -> Array:
    """Return where the parts of the line begin, span 0, wrap of pulley 1, ..., and its end [m]."""
    parts = np.column_stack([line.spans, np.roll(radii * line.wraps, -1)])
    return np.append(0.0, np.cumsum(parts))


def line_parts(line: Route, radii: Array) -> Array:
    """Return where each wrap begins and ends along the line (n_p, 2) [m]; pulley 0 comes last."""
    return np.roll(line_edges(line, radii)[1:].reshape(-1, 2), 1, axis=0)


def where(params: Params, points: Array, lines: list[Route], centers: Array) -> Array:
    """Return the places along the line (n_t, n_b) [m] of points of the belt, in its order.

    Each is projected on the nearest span or wrap; where several are near, as where a belt crosses
    itself, on that to which the chords between the points lead.
    """
    radii = params._radii
    length = np.array([line.length for line in lines])[:, None]
    edges = np.array([line_edges(line, radii) for line in lines])
    leave, senses = np.array([line.leave for line in lines]), lines[0].senses
    arrive = np.array([line.arrive for line in lines])
    places, apart = [], []
    for k in range(radii.size):
        after = (k + 1) % radii.size
        # the span that follows pulley k
        way = arrive[:, after] - leave[:, k]
        span = np.maximum(np.hypot(way[:, 0], way[:, 1]), 1e-300)[:, None]
        along = way[:, None] / span[..., None]
        off = points - leave[:, k, None]
        at = np.clip((off * along).sum(axis=-1), 0.0, span)
        places.append(edges[:, 2 * k, None] + at)
        apart.append(np.hypot(*np.moveaxis(off - at[..., None] * along, -1, 0)))
        # the wrap of the next pulley, from its middle
        off = points - centers[:, after, None]
        arc, radius, sense = edges[:, 2 * k + 1 : 2 * k + 3], radii[after], senses[after]
        half = 0.5 * np.diff(arc) / radius
        middle = _turned((arrive[:, after] - centers[:, after])[:, None], sense * half)
        angle = np.clip(sense * turns(middle, off), -half, half)
        places.append(arc[:, :1] + radius * (angle + half))
        on_rim = _turned(middle, sense * angle)
        apart.append(np.hypot(*np.moveaxis(off - on_rim, -1, 0)))
    place, distance = np.stack(places), np.stack(apart)
    # along the chords, from wherever most of the nearest projections agree
    chords = np.hypot(*np.moveaxis(np.roll(points, -1, axis=1) - points, -1, 0))
    counted = np.cumsum(chords, axis=1) - chords
    counted = counted * (length / chords.sum(axis=1, keepdims=True))
    nearest = np.take_along_axis(place, distance.argmin(axis=0)[None], axis=0)[0]
    turned = (nearest - counted) * (2.0 * np.pi / length)
    most = np.arctan2(np.sin(turned).sum(axis=1), np.cos(turned).sum(axis=1))[:, None]
    ahead = np.arctan2(np.sin(turned - most), np.cos(turned - most))
    begin = (most + np.median(ahead, axis=1, keepdims=True)) * length / (2.0 * np.pi)
    difference = place - counted - begin
    difference -= length * np.round(difference / length)
    best = (distance + np.abs(difference)).argmin(axis=0)[None]
    return np.asarray(np.take_along_axis(place, best, axis=0)[0] % length)


def _turned(vectors: Array, angle: Array) -> Array:
    """Return vectors (..., 2), turned counter-clockwise by angles (...)."""
    x, y, c, s = vectors[..., 0], vectors[..., 1], np.cos(angle), np.sin(angle)
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def along(run: Sampled, name: str, places: Array | None, rows: Any = ALL) -> AlongBelt:
    """Return a history in places, at some samples; see :meth:`beltdyn.Result.along_belt`."""
    params, line, (group, _, field) = run.params, run.params.route, name.partition(".")
    values = getattr(getattr(run, group), field)[rows]
    edges = line_edges(line, params._radii)
    if params._flows:
        s, found = _of_cells(params, name, values, places)
    else:
        s = (np.arange(params.n_bodies) + 0.5) * (edges[-1] / params.n_bodies)
        s = s if places is None else places
        found = _of_links(run, name, values, s, np.arange(run.t.size)[rows])
    names = params.pulley_names
    pairs = zip(span_names(names), (*names[1:], names[0]), strict=True)
    texts = np.array([text for pair in pairs for text in pair])
    # the end of the line is the end of its last part
    part = texts[np.searchsorted(edges[1:-1], s, side="right")]
    return AlongBelt(
        name=name,
        t=run.t[rows],
        s=s,
        values=found,
        part=part,
        wraps=line_parts(line, params._radii),
        length=line.length,
    )


def _of_links(run: Sampled, name: str, values: Array, s: Array, rows: NDArray[np.intp]) -> Array:
    """Interpolate a history of joints or links, at these samples of a run."""
    params, belt, travel = run.params, run.belt, run._travel
    radii, found = params._radii, np.empty((rows.size, s.size))
    edges = line_edges(params.route, radii)
    size = max(1, _BLOCK // (2 * radii.size * params.n_bodies))
    for begin in range(0, rows.size, size):
        block = rows[begin : begin + size]
        if name.startswith("contact."):
            points = contact_points(params, belt, block)
        elif name.startswith("joints."):
            points = joint_points(params, belt, block)
        else:
            points = np.stack([belt.x[block], belt.y[block]], axis=-1)
        lines, centers = routes(params, None if travel is None else travel[block])
        at = where(params, points, lines, centers)
        for k, (place, now) in enumerate(zip(at, cycle(lines), strict=False), begin):
            # where axes have moved, at the same share of its part
            asked = s if now is params.route else np.interp(s, edges, line_edges(now, radii))
            found[k] = np.interp(asked, place, values[k], period=now.length)
    return found


def cell_places(params: Params) -> Array:
    """Return where along the line cells of an ALE belt begin, and the length of it [m]."""
    cells = params._cells
    first = np.flatnonzero(np.diff(cells, prepend=-2))  # of each part
    edges = line_edges(params.route, params._radii)
    return np.interp(np.arange(cells.size + 1), np.append(first, cells.size), edges)


def _of_cells(
    params: Params, name: str, values: Array, places: Array | None
) -> tuple[Array, Array]:
    """Return places and a history there, linear between middles of cells, constant in spans."""
    edges = cell_places(params)
    middles = 0.5 * (edges[1:] + edges[:-1])
    s = middles if places is None else places
    if name.startswith("belt."):  # where the cells begin
        at, columns = edges, np.append(np.arange(middles.size), 0)
    else:
        spans = np.flatnonzero(params._cells < 0)
        at = np.concatenate([middles, edges[spans], edges[spans + 1]])
        columns = np.concatenate([np.arange(middles.size), spans, spans])
        order = np.argsort(at, kind="stable")
        at, columns = at[order], columns[order]
    found = np.array([np.interp(s, at, row[columns], period=edges[-1]) for row in values])
    return s, found.reshape(len(values), s.size)


def follow(
    params: Params, force: Array, passed: Array, cell: int, at: int = -1
) -> tuple[NDArray[np.intp], Array]:
    """Follow a mark on an ALE belt, which is in the middle of a cell at one sample."""
    held = np.diff(cell_places(params)) / Span(params.belt, force).stretch
    length = held.sum(axis=1)  # stress-free, but for bends and sinking in
    ends = np.cumsum(held, axis=1)
    now = (ends[at, cell] - 0.5 * held[at, cell]) / length[at]
    share = (now + (passed - passed[at]) / float(params.info["length"])) % 1.0
    found = np.sum(ends <= (share * length)[:, None], axis=1)
    found = np.minimum(found, ends.shape[1] - 1)
    rows = np.arange(passed.size)
    return found, 1.0 - (ends[rows, found] - share * length) / held[rows, found]


def momentum_flux(run: Sampled) -> Array:
    """Return the part of the hub loads that turns the belt's momentum (n_t, n_p, 2) [N].

    ``m c (v_1 d_1 + v_2 d_2)`` with the flow c, the stress-free length that passes in a second, and
    the speeds v = c (1 + T / EA) of the spans beside a pulley, whose directions away from it are d.
    """
    params, belt, mean = run.params, run.belt, run.joints.force.mean(axis=1)
    if params._flows:
        flow = belt.flow
    else:
        speed = (belt.vx * np.cos(belt.phi) + belt.vy * np.sin(belt.phi)).mean(axis=1)
        flow = speed / Span(params.belt, mean).stretch
    tension = np.where(np.isnan(run.span_tension), mean[:, None], run.span_tension)
    pull = Span(params.belt, tension, flow[:, None]).centrifugal
    return force_on_pulleys(routes(params, run._travel)[0], pull)


def force_on_pulleys(lines: list[Route], pull: Array) -> Array:
    """Return the force on each pulley (n_t, n_p, 2) of spans that pull along themselves (n_t, n_p).

    Lines are those at the samples, or one.
    """
    way = np.array([line._ways for line in lines])
    length = np.hypot(way[..., 0], way[..., 1])[..., None]
    one_way = pull[..., None] * np.divide(way, length, out=np.zeros_like(way), where=length > 0.0)
    return np.asarray(one_way - np.roll(one_way, 1, axis=1))
