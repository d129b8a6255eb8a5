"""The drive to scale: drawn once, then moved to any sample."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from numpy.typing import NDArray

from ..base.checks import Array, flag, pair, real
from ..outputs.arcs import full_friction
from ..outputs.places import follow
from ..outputs.quantity import QUANTITIES
from ..outputs.spans import has_angles, lines_of_cells
from ..result.result import Result
from . import style
from .labels import draw_name, per_unit, place_names
from .mounting import MountPicture, draw_pulley
from .panel import Indices, choice, named_links, runs

_MAPS = {"tension": "viridis", "friction": "PuOr_r"}
_LABELS = {
    "tension": QUANTITIES["joints.force"].axis(short="belt tension"),
    "friction": QUANTITIES["contact.mu"].axis(),
}
#: Marks of stick and slip: name, colour, dashes; and where they run, in radii.
_ARCS = (
    ("belt sticks", style.COLOURS[0], "-"),
    ("belt slips", style.COLOURS[1], (0, (1.0, 0.8))),
)
_ARC_AT, _SPOKE, _ARROW_AT = 0.86, (0.55, 0.80), 0.42
#: Width of the mark and size of the arrow on a small pulley, in radii.
_SPOKE_WIDTH, _ARROW_SIZE = 0.16, 0.64
#: Arrows show pulleys that turn faster than this share of the highest speed in the run.
_TURNS = 1e-3


class DrivePicture:
    """The artists of a drive, of which :meth:`move` shows any sample of ``rows``."""

    def __init__(
        self,
        result: Result,
        rows: slice,
        colour: str | None,
        arcs: bool,
        slip_from: float,
        links: Indices | Mapping[str, int] | None,
        limits: tuple[float, float] | None,
    ) -> None:
        choice("colour", colour, ("tension", "friction", None))
        arcs = flag("arcs", arcs)
        if not 0.0 < real("slip_from", slip_from) <= 1.0:
            raise ValueError(f"slip_from must be > 0 and <= 1, got {slip_from:g}")
        params = result.params
        if colour == "friction" and not params.has_friction:
            raise ValueError('colour must not be "friction" for a drive without friction')
        self._result, self._params = result, params
        self._rows, self._shown = rows, range(len(result.t))[rows]
        self._colour = colour
        self._links = named_links(links, params.n_bodies)
        self._slip_from = slip_from
        self._kinds = _ARCS if arcs and params.has_friction else ()
        self._moves = result.mounts is not None
        self._flows = params._flows
        self._limits = self._scale(limits)
        self._followed = [self._follow(link) for link in self._links.values()]

    def _follow(self, link: int) -> tuple[NDArray[np.intp], Array] | None:
        """Follow a mark on a belt that flows; None: links carry it, or it is not known."""
        result = self._result
        if not (self._flows and result._has("belt.passed") and result._has("joints.force")):
            return None
        force, passed = result.joints.force, result.belt.passed
        return follow(self._params, force, passed, link, self._shown[0])

    def _scale(self, limits: object) -> tuple[float, float]:
        if limits is not None:
            low, high = pair("limits", limits, "1" if self._colour == "friction" else "N")
            if not low < high:
                raise ValueError(f"limits must rise, got {low:g}, {high:g}")
            return low, high
        if self._colour == "friction":
            most = float(self._params._slip_limits[0].max())
            return -most, most
        tension = self._tension(self._rows)
        return float(tension.min()), float(tension.max())

    # --- drawing once ----------------------------------------------------------------------------

    def draw(self, ax: Axes) -> None:
        """Add all artists to the axes; :meth:`move` then places them."""
        self._mounts = MountPicture(ax, self._params.pulleys)
        pulleys = list(enumerate(self._params.pulleys))
        self._rims = [draw_pulley(ax, pulley.center, pulley.radius) for _, pulley in pulleys]
        look: dict[str, Any] = {"color": "0.35", "lw": 2.2, "solid_capstyle": "butt"}
        self._spokes = [ax.plot([], [], zorder=1.5, **look)[0] for _ in pulleys]
        self._titles = [
            draw_name(
                ax,
                style.title(k, pulley),
                pulley.center,
                fontsize="medium" if pulley.name is None else "small",
                zorder=3.5,
            )
            for k, pulley in pulleys
        ]
        look = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0, "zorder": 2}
        self._arrows = [
            FancyArrowPatch((0, 0), (1, 1), color="0.25", lw=1.1, **look) for _ in pulleys
        ]
        for arrow in self._arrows:
            ax.add_patch(arrow)
        self._arcs = [
            LineCollection([], colors=colour, linestyles=[dashes], linewidths=3.2, zorder=2)
            for _, colour, dashes in self._kinds
        ]
        # The dark edge separates the light end of the colour map from the background.
        self._edge = LineCollection([], colors="0.15", linewidths=5.0, capstyle="round", zorder=3)
        self._belt = LineCollection([], linewidths=3.6, capstyle="round", zorder=3.1)
        if self._colour is None:
            self._belt.set_color("0.45")
        for collection in (*self._arcs, self._edge, self._belt):
            ax.add_collection(collection, autolim=False)
        look = {"ms": 8, "mfc": "white", "mew": 2, "ls": "", "zorder": 4}
        self._marks = []
        for k, name in enumerate(self._links):
            edge = style.COLOURS[(k + 3) % len(style.COLOURS)]
            self._marks += ax.plot([], [], marker="os^Dv"[k % 5], mec=edge, label=name, **look)
        style.dress(ax, "x [m]", "y [m]")
        ax.set(aspect="equal", xlim=self._frame[:, 0], ylim=self._frame[:, 1])
        if self._colour is not None:
            self._belt.set_cmap(colormaps[_MAPS[self._colour]].with_extremes(bad=style.FREE))
            self._belt.set_clim(*self._limits)
            self._colour_bar(ax, self._colour)

    def _centers(self, row: int) -> Array:
        """Axes of the pulleys at a sample (n_p, 2) [m]."""
        mounts = self._result.mounts
        return np.asarray(self._params.centers(None if mounts is None else mounts.travel[row]))

    @property
    def wide(self) -> bool:
        """Whether the drive is wider than it is high."""
        width, height = np.ptp(self._extent, axis=0)
        return bool(width > 1.5 * height)

    @property
    def height(self) -> float:
        """Height of a figure that the picture fills [inch]."""
        bar = self._colour is not None
        beside, below = (0.8, 1.2 + 0.8 * bar) if self.wide else (0.8 + 0.9 * bar, 1.2)
        return style.height_to_scale(np.ptp(self._frame, axis=0), beside, below)

    @cached_property
    def _extent(self) -> Array:
        """Corners of what holds pulleys and belt at all samples (2, 2) [m]."""
        belt, pulleys, rows = self._result.belt, self._params.pulleys, self._shown
        # of axes that move, at some twenty of the samples: the belt is looked at in all
        some = rows[:: max(1, len(rows) // 20)] if self._moves else rows[:1]
        centers = np.concatenate([self._centers(row) for row in some])
        radii = np.tile(self._params._radii, len(some))[:, None]
        at = np.stack([belt.x[self._rows].ravel(), belt.y[self._rows].ravel()], axis=-1)
        held = np.concatenate([at, centers - radii, centers + radii, MountPicture.reach(pulleys)])
        return np.array([held.min(axis=0), held.max(axis=0)])

    @property
    def _frame(self) -> Array:
        """Corners of the axes (2, 2) [m]."""
        margin = 0.05 * float(np.ptp(self._extent, axis=0).max())
        # Names of pulleys that are small in a wide drive stand above and below it.
        room = np.array([margin, 1.8 * margin if self.wide else margin])
        return np.asarray(self._extent + np.array([[-1.0], [1.0]]) * room)

    def _colour_bar(self, ax: Axes, colour: str) -> None:
        where: dict[str, Any] = {"orientation": "vertical", "aspect": 25, "shrink": 0.9}
        if self.wide:
            entries = len(self._arcs) + (colour == "friction") + len(self._links)
            pad = style.room_below(ax, rows=-(-entries // style.LEGEND_COLUMNS))
            where = {"orientation": "horizontal", "aspect": 30, "shrink": 0.9} | pad
        ax.figure.colorbar(self._belt, ax=ax, label=_LABELS[colour], **where)

    # --- moving ----------------------------------------------------------------------------------

    def move(self, row: int) -> list[Artist]:
        """Show another sample; return the artists that changed."""
        result = self._result
        ends_of = self._ends(row)
        self._belt.set_segments(ends_of)
        self._edge.set_segments(ends_of)
        if self._colour == "tension":
            self._belt.set_array(self._tension(row))
        elif self._colour == "friction":
            on = result.contact.pulley[row] >= 0
            self._belt.set_array(np.ma.masked_where(~on, result.contact.mu[row]))
        centers, radii = self._centers(row), self._params._radii
        fastest = np.abs(result.pulleys.omega).max()
        for k, (center, radius) in enumerate(zip(centers, radii, strict=True)):
            angle, omega = result.pulleys.theta[row, k], result.pulleys.omega[row, k]
            along = radius * np.array([np.cos(angle), np.sin(angle)])
            self._spokes[k].set_data(*np.array([center + share * along for share in _SPOKE]).T)
            self._rims[k].set_center(tuple(center))
            self._titles[k].set_position(tuple(center))
            sense = 1 if omega > 0 else -1  # round the axis, anticlockwise for +1
            ends = np.deg2rad([-35.0, 35.0]) * sense - np.pi / 2.0
            at = center[:, None] + _ARROW_AT * radius * np.array([np.cos(ends), np.sin(ends)])
            self._arrows[k].set_positions(*at.T)
            self._arrows[k].set_connectionstyle("arc3", rad=0.32 * sense)
            self._arrows[k].set_visible(bool(abs(omega) > _TURNS * fastest))
        if self._arcs:
            on, slips = self._states(row)
            for collection, chosen in zip(self._arcs, (on & ~slips, slips), strict=True):
                collection.set_segments(self._rim_arcs(row, chosen, ends_of))
        for mark, link, followed in zip(
            self._marks, self._links.values(), self._followed, strict=True
        ):
            x, y = result.belt.x[row, link], result.belt.y[row, link]
            if followed is not None:
                line, part = ends_of[int(followed[0][row])], followed[1][row]
                x, y = (np.interp(part, np.linspace(0.0, 1.0, len(line)), one) for one in line.T)
            mark.set_data([x], [y])
        return [
            *(self._rims + self._titles if self._moves else []),
            *self._mounts.move(centers),
            self._belt,
            self._edge,
            *self._spokes,
            *self._arcs,
            *self._marks,
            *self._arrows,
        ]

    def _tension(self, rows: int | slice) -> Array:
        """Tension of links, the mean of the joints at their ends; of cells their own."""
        force = self._result.joints.force[rows]
        return force if self._flows else (force + np.roll(force, -1, axis=-1)) / 2.0

    def _ends(self, row: int) -> list[Array]:
        """Both ends of each link, of a string of the bar behind each mass; lines of cells [m]."""
        result, belt = self._result, self._result.belt
        centre = np.stack([belt.x[row], belt.y[row]], axis=-1)
        if self._flows:
            there = result._has("spans.deflection")
            shape = result.spans.deflection[row] if there else None
            return lines_of_cells(self._params, centre, self._centers(row), shape)
        if not has_angles(self._params):
            return list(np.stack([centre, np.roll(centre, -1, axis=0)], axis=1))
        half = self._params.info["link_length"] / 2.0
        along = half * np.stack([np.cos(belt.phi[row]), np.sin(belt.phi[row])], axis=-1)
        return list(np.stack([centre - along, centre + along], axis=1))

    def _states(self, rows: int | slice) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Find the links that touch a pulley, and those of them that slip."""
        contact = self._result.contact
        known = self._result._has("contact.velocity")
        velocity = contact.velocity[rows] if known else None
        touched, mu = contact.pulley[rows], contact.mu[rows]
        full = full_friction(self._params, touched, velocity)
        on = touched >= 0
        return on, on & (np.abs(mu) >= self._slip_from * full)

    def _rim_arcs(self, row: int, chosen: NDArray[np.bool_], ends: list[Array]) -> list[Array]:
        """One polyline per run of links of the same state on the same pulley."""
        touched = np.where(chosen, self._result.contact.pulley[row], -1)
        centers = self._centers(row)[touched]
        off = np.array([line[[0, -1]] for line in ends]) - centers[:, None]
        angles = np.arctan2(off[..., 1], off[..., 0])
        turn = (angles[:, 1] - angles[:, 0] + np.pi) % (2.0 * np.pi) - np.pi
        steps = angles[:, :1] + turn[:, None] * np.linspace(0.0, 1.0, 5)
        at = _ARC_AT * self._params._radii[touched]
        arcs = centers[:, None] + at[:, None, None] * np.stack([np.cos(steps), np.sin(steps)], -1)
        return [arcs[begin:end].reshape(-1, 2) for begin, end, k in runs(touched) if k >= 0]

    def _place_names(self, ax: Axes) -> None:
        """Put names that do not fit on their pulleys beside them, as at the first sample shown."""
        row, radii = self._shown[0], self._params._radii
        pivots = MountPicture.reach(self._params.pulleys)
        belt = np.stack([self._result.belt.x[row], self._result.belt.y[row]], axis=-1)
        place_names(ax, self._titles, self._centers(row), radii, belt, marks=-1, pivots=pivots)
        for rim, spoke, arrow in zip(radii * per_unit(ax), self._spokes, self._arrows, strict=True):
            spoke.set_linewidth(min(2.2, _SPOKE_WIDTH * rim))
            arrow.set_mutation_scale(min(9.0, _ARROW_SIZE * rim))

    # --- legend ----------------------------------------------------------------------------------

    def add_legend(self, ax: Axes) -> None:
        """Add a legend below the axes for arcs and highlighted links; the last of the layout."""
        handles: list[Artist] = []
        if self._arcs:
            on, slips = self._states(self._rows)
            there = ((on & ~slips).any(), slips.any())
            handles = [
                Line2D([], [], color=colour, ls=dashes, lw=3.2, label=name)
                for (name, colour, dashes), shown in zip(self._kinds, there, strict=True)
                if shown
            ]
        if self._colour == "friction":
            handles.append(Line2D([], [], color=style.FREE, lw=3.6, label="no contact"))
        handles += self._marks
        if handles:
            style.legend_below(ax, handles)
        self._place_names(ax)
