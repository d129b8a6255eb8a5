"""The drive to scale, at one time or running; it and histories in one figure."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from numpy.typing import NDArray

from ..base.checks import Array, flag, pair, positive, real
from ..outputs.arcs import full_friction
from ..outputs.places import follow
from ..outputs.quantity import QUANTITIES
from ..outputs.spans import has_angles, lines_of_cells
from ..result.result import Result
from . import style
from .animation import Animation
from .history import force_along_belt, span_tensions, speeds
from .labels import per_unit
from .panel import Indices, choice, draws, named_links, runs, sample
from .to_scale import Machine, reach

#: What colours the belt: the map and the label of its bar.
_COLOURS = {
    "tension": ("viridis", QUANTITIES["joints.force"].axis(short="belt tension")),
    "friction": ("PuOr_r", QUANTITIES["contact.mu"].axis()),
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
#: What an animation shows below the drive.
_PANELS: dict[str, Any] = {"tensions": span_tensions, "speeds": speeds}


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
        choice("colour", colour, (*_COLOURS, None))
        arcs = flag("arcs", arcs)
        if not 0.0 < real("slip_from", slip_from) <= 1.0:
            raise ValueError(f"slip_from must be > 0 and <= 1, got {slip_from:g}")
        params = result.params
        if colour == "friction" and not params.has_friction:
            raise ValueError('colour must not be "friction" for a drive without friction')
        self._result, self._params = result, params
        self._rows, self._shown = rows, range(len(result.t))[rows]
        self._colour = colour
        self._links = named_links(links, params)
        self._slip_from = slip_from
        self._marked = arcs and params.has_friction
        self._limits = self._scale(limits)
        self._followed = [self._follow(link) for link in self._links.values()]

    def _follow(self, link: int) -> tuple[NDArray[np.intp], Array] | None:
        """Follow a mark on a belt that flows; None: links carry it, or it is not known."""
        result = self._result
        if not (self._params._flows and result._has("belt.passed") and result._has("joints.force")):
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
        tension = self._values(self._rows)
        return float(tension.min()), float(tension.max())

    # --- drawing once ----------------------------------------------------------------------------

    def draw(self, ax: Axes) -> None:
        """Draw the first of the samples, and the legend below; in a figure the last to be drawn."""
        pulleys = self._params.pulleys
        self._machine = Machine(ax, pulleys, np.array([pulley.center for pulley in pulleys]))
        self._machine.name(zorder=3.5)
        look: dict[str, Any] = {"color": "0.35", "lw": 2.2, "solid_capstyle": "butt"}
        self._spokes = [ax.plot([], [], zorder=1.5, **look)[0] for _ in pulleys]
        look = {"arrowstyle": "-|>", "mutation_scale": 9, "shrinkA": 0, "shrinkB": 0, "zorder": 2}
        self._arrows = [
            FancyArrowPatch((0, 0), (1, 1), color="0.25", lw=1.1, **look) for _ in pulleys
        ]
        for arrow in self._arrows:
            ax.add_patch(arrow)
        look = {"linewidths": 3.2, "zorder": 2}
        self._arcs = [
            LineCollection([], colors=colour, linestyles=[dashes], label=name, **look)
            for name, colour, dashes in _ARCS[: len(_ARCS) * self._marked]
        ]
        # The dark edge separates the light end of the colour map from the background.
        self._edge = LineCollection([], colors="0.15", linewidths=5.0, capstyle="round", zorder=3)
        self._belt = LineCollection([], linewidths=3.6, capstyle="round", zorder=3.1)
        for collection in (*self._arcs, self._edge, self._belt):
            ax.add_collection(collection, autolim=False)
        look = {"ms": 8, "mfc": "white", "mew": 2, "ls": "", "zorder": 4}
        self._marks = []
        for k, name in enumerate(self._links):
            edge = style.COLOURS[(k + 3) % len(style.COLOURS)]
            self._marks += ax.plot([], [], marker="os^Dv"[k % 5], mec=edge, label=name, **look)
        style.dress(ax, "x [m]", "y [m]")
        ax.set(aspect="equal", xlim=self._frame[:, 0], ylim=self._frame[:, 1])
        states = self._states(self._rows) if self._marked else ()
        handles: list[Any] = [
            arc for arc, there in zip(self._arcs, states, strict=True) if there.any()
        ]
        if self._colour == "friction":
            handles.append(Line2D([], [], color=style.FREE, lw=3.6, label="no contact"))
        handles += self._marks
        if self._colour is None:
            self._belt.set_color("0.45")
        else:
            colours, label = _COLOURS[self._colour]
            self._belt.set(cmap=colormaps[colours].with_extremes(bad=style.FREE))
            self._belt.set_clim(*self._limits)
            where: dict[str, Any] = {"orientation": "vertical", "aspect": 25}
            if self.wide:
                pad = style.room_below(ax, rows=-(-len(handles) // style.LEGEND_COLUMNS))
                where = {"orientation": "horizontal", "aspect": 30, **pad}
            ax.figure.colorbar(self._belt, ax=ax, label=label, shrink=0.9, **where)
        self.move(self._shown[0])
        style.legend_below(ax, handles)
        belt = self._result.belt
        self._machine.place_names(np.stack([belt.x, belt.y], axis=-1)[self._shown[0]], marks=-1)
        rims = self._params._radii * per_unit(ax)
        for rim, spoke, arrow in zip(rims, self._spokes, self._arrows, strict=True):
            spoke.set_linewidth(min(2.2, _SPOKE_WIDTH * rim))
            arrow.set_mutation_scale(min(9.0, _ARROW_SIZE * rim))

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
        some = rows[:: max(1, len(rows) // 20)] if self._result.mounts is not None else rows[:1]
        centers = np.concatenate([self._centers(row) for row in some])
        radii = np.tile(self._params._radii, len(some))[:, None]
        at = np.stack([belt.x[self._rows].ravel(), belt.y[self._rows].ravel()], axis=-1)
        held = np.concatenate([at, centers - radii, centers + radii, reach(pulleys)])
        return np.array([held.min(axis=0), held.max(axis=0)])

    @property
    def _frame(self) -> Array:
        """Corners of the axes (2, 2) [m]."""
        margin = 0.05 * float(np.ptp(self._extent, axis=0).max())
        # Names of pulleys that are small in a wide drive stand above and below it.
        room = np.array([margin, 1.8 * margin if self.wide else margin])
        return np.asarray(self._extent + np.array([[-1.0], [1.0]]) * room)

    # --- moving ----------------------------------------------------------------------------------

    def move(self, row: int) -> None:
        """Show another sample."""
        result = self._result
        ends_of = self._ends(row)
        self._belt.set_segments(ends_of)
        self._edge.set_segments(ends_of)
        if self._colour is not None:
            self._belt.set_array(self._values(row))
        centers, radii = self._centers(row), self._params._radii
        self._machine.move(centers)
        fastest = np.abs(result.pulleys.omega).max()
        for k, (center, radius) in enumerate(zip(centers, radii, strict=True)):
            angle, omega = result.pulleys.theta[row, k], result.pulleys.omega[row, k]
            along = radius * np.array([np.cos(angle), np.sin(angle)])
            self._spokes[k].set_data(*np.array([center + share * along for share in _SPOKE]).T)
            sense = 1 if omega > 0 else -1  # round the axis, anticlockwise for +1
            ends = np.deg2rad([-35.0, 35.0]) * sense - np.pi / 2.0
            at = center[:, None] + _ARROW_AT * radius * np.array([np.cos(ends), np.sin(ends)])
            self._arrows[k].set_positions(*at.T)
            self._arrows[k].set_connectionstyle("arc3", rad=0.32 * sense)
            self._arrows[k].set_visible(bool(abs(omega) > _TURNS * fastest))
        for arc, there in zip(self._arcs, self._states(row) if self._marked else (), strict=True):
            arc.set_segments(self._rim_arcs(row, there, ends_of))
        for mark, link, followed in zip(
            self._marks, self._links.values(), self._followed, strict=True
        ):
            x, y = result.belt.x[row, link], result.belt.y[row, link]
            if followed is not None:
                line, part = ends_of[int(followed[0][row])], followed[1][row]
                x, y = (np.interp(part, np.linspace(0.0, 1.0, len(line)), one) for one in line.T)
            mark.set_data([x], [y])

    def _values(self, rows: int | slice) -> Array:
        """Return what colours the links: mean tensions of their ends, of cells their own; mu."""
        contact = self._result.contact
        if self._colour == "friction":
            return np.ma.masked_where(contact.pulley[rows] < 0, contact.mu[rows])
        force = self._result.joints.force[rows]
        return force if self._params._flows else (force + np.roll(force, -1, axis=-1)) / 2.0

    def _ends(self, row: int) -> list[Array]:
        """Both ends of each link, of a string of the bar behind each mass; lines of cells [m]."""
        result, belt = self._result, self._result.belt
        centre = np.stack([belt.x[row], belt.y[row]], axis=-1)
        if self._params._flows:
            there = result._has("spans.deflection")
            shape = result.spans.deflection[row] if there else None
            return lines_of_cells(self._params, centre, self._centers(row), shape)
        if not has_angles(self._params):
            return list(np.stack([centre, np.roll(centre, -1, axis=0)], axis=1))
        half = self._params.info["link_length"] / 2.0
        along = half * np.stack([np.cos(belt.phi[row]), np.sin(belt.phi[row])], axis=-1)
        return list(np.stack([centre - along, centre + along], axis=1))

    def _states(self, rows: int | slice) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Find the links that stick to a pulley, and those that slip on it."""
        contact = self._result.contact
        known = self._result._has("contact.velocity")
        touched, velocity = contact.pulley[rows], contact.velocity[rows] if known else None
        full = full_friction(self._params, touched, velocity)
        slips = np.abs(contact.mu[rows]) >= self._slip_from * full
        return (touched >= 0) & ~slips, (touched >= 0) & slips

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


@draws()
def drive(
    result: Result,
    t: float | None = None,
    *,
    colour: str | None = "tension",
    arcs: bool = True,
    slip_from: float = 0.95,
    links: Indices | Mapping[str, int] | None = None,
    limits: tuple[float, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Draw the drive to scale at one time, as Fig. 5 of the paper.

    Pulleys carry their name or number, beside them if they are small, a mark that turns with them
    and, while they turn, an arrow.
    """
    row = sample(result, t)
    rows = slice(row, row + 1)
    picture = DrivePicture(result, rows, colour, arcs, slip_from, links, limits)
    ax = style.axes(ax, picture.height)
    ax.set_title(f"t = {result.t[row]:.4g} s", fontsize="medium")
    picture.draw(ax)
    return ax


@draws()
def overview(result: Result, *, t: float | None = None, fig: Figure | None = None) -> Figure:
    """Draw pulley speeds, span tensions, the forces along the belt and the drive to scale.

    Args:
        t: Time of the lower two panels [s], the nearest sample; None: the last.
        fig: Figure to draw into; None: a new one.
    """
    time = result.t[sample(result, t)]
    figure = style.new_figure(10.0, 7.0, dpi=150) if fig is None else fig
    grid = figure.add_gridspec(2, 2, height_ratios=[1.0, 1.3])
    upper = [figure.add_subplot(grid[0, k]) for k in range(2)]
    # Grids of their own: the room below the drive, for its legend, is not taken from the other.
    lower = [figure.add_subplot(grid[1, k].subgridspec(1, 1)[0]) for k in range(2)]
    of_belt, of_drive = (f"{what} at t = {time:.4g} s" for what in ("Along the belt", "The drive"))
    titles = ("Pulley speeds", "Span tensions", of_belt, of_drive)
    for ax, title in zip(upper + lower, titles, strict=True):
        ax.set_title(title)
    force_along_belt(result, time, ax=lower[0]).set_title(of_belt)
    drive(result, time, ax=lower[1]).set_title(of_drive)
    # Last, when it is known how much room is left for their legends; first the longer names.
    span_tensions(result, ax=upper[1])
    speeds(result, ax=upper[0])
    return figure


@draws()
def animate(
    result: Result,
    *,
    duration: float = 5.0,
    fps: float = 20.0,
    colour: str | None = "tension",
    panel: str | None = "tensions",
    arcs: bool = True,
    slip_from: float = 0.95,
    links: Indices | Mapping[str, int] | None = 0,
    limits: tuple[float, float] | None = None,
) -> Animation:
    """Animate the drive: the belt running, coloured by tension.

    A notebook shows it; ``.save("drive.gif")`` writes it, as does ``"drive.mp4"`` and
    ``"drive.html"``. The frames are samples of the run, equally spaced in time as nearly as the
    samples are; fewer samples than frames give fewer frames, each shown for longer. The title
    shows the time and by how much the animation is slower than the drive. An MP4 needs ffmpeg, or
    ``pip install imageio-ffmpeg``.

    Args:
        duration: Duration of the animation [s].
        fps: Frames per second. A frame of a GIF lasts whole hundredths of a second, so 10, 20, 25
            and 50 are exact.
        panel: What to draw below the drive over time: "tensions", "speeds" or None.
    """
    seconds, rate = positive("duration", duration, "s"), positive("fps", fps, "1/s")
    choice("panel", panel, (*_PANELS, None))
    rows = _frames(result, max(1, round(seconds * rate)))
    picture = DrivePicture(result, slice(None), colour, arcs, slip_from, links, limits)
    heights = [2.2, 1.0] if panel else [1.0]
    height = 4.4 if picture.wide else 5.2
    height += 1.2 + 0.1 * len(result.params.pulleys) if panel else 0.0  # a line of legend for two
    figure = style.new_figure(height=height, own=True)
    drive_axes, *below = figure.subplots(len(heights), 1, height_ratios=heights, squeeze=False).flat
    title = drive_axes.set_title(" ", fontsize="medium")
    marks = []
    for ax in below:
        _PANELS[str(panel)](result, ax=ax)
        marks.append(ax.axvline(result.t[rows[0]], color="0.25", linewidth=1.0))
    picture.draw(drive_axes)
    pace = _pace(seconds, float(result.t[-1] - result.t[0]))
    digits = _digits(result.t[rows])

    def show(row: np.int64) -> None:
        now = float(result.t[row])
        title.set_text(f"t = {now:.{digits}f} s   ({pace})")
        for mark in marks:
            mark.set_xdata([now, now])
        picture.move(int(row))

    return Animation(figure, show, rows, len(rows) / seconds)


def _frames(result: Result, count: int) -> NDArray[np.int64]:
    """Choose the samples nearest to equally spaced times."""
    t = result.t
    times = np.linspace(t[0], t[-1], min(count, t.size))
    return np.ceil(np.interp(times, t, np.arange(t.size)) - 0.5).astype(np.int64)


def _pace(film: float, run: float) -> str:
    if run <= 0.0:
        return "one moment"
    ratio = film / run
    if 0.95 < ratio < 1.05:
        return "real time"
    return f"{ratio:.2g}x slower" if ratio > 1.0 else f"{1.0 / ratio:.2g}x faster"


def _digits(times: NDArray[np.float64]) -> int:
    """Decimals needed to distinguish the times of successive frames."""
    step = (times[-1] - times[0]) / max(len(times) - 1, 1)
    return int(np.clip(np.ceil(-np.log10(step)) if step > 0.0 else 3, 0, 9))
