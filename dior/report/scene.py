"""A session's cameras and walks: in space, from above and from the side.

INPUTS   `Camera`s with a pose, walks (N, 3) m in the world, one pose (J, 3) m
OUTPUT   one SVG; the oblique view is an orthographic projection, drawn here, which is small and keeps lengths along
         the page comparable
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from dior.arrays import Floats
from dior.body import names as skeletons
from dior.geometry.camera import Camera, rays
from dior.report.colours import COLOURS, DARK, EDGE, GREY, GRID, ORANGE, WHITE, colours_of
from dior.report.svg import new_figure, save_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Annotation

# by sequence, (N, 3) m
Walks: TypeAlias = Mapping[str, Floats]
# points (J, 3) m and the names of their joints
Pose: TypeAlias = tuple[Floats, list[str]]
# a camera further than this from the walks is only pointed at, m; chosen: close cameras are within 10, far ones at 60
NEAR = 20.0
# where else a name may stand: points from what it names, and how it is aligned there
PLACES = (
    ((0, 7), "center", "bottom"), ((0, -7), "center", "top"), ((8, 0), "left", "center"), ((-8, 0), "right", "center"),
    ((8, 14), "left", "bottom"), ((-8, 14), "right", "bottom"), ((8, -14), "left", "top"), ((-8, -14), "right", "top"),
    ((0, 20), "center", "bottom"), ((0, -20), "center", "top"),
)  # fmt: skip
# walks beyond this many have no names beside them; chosen: as many as four rows of the legend hold
NAMED = 12
# from where the scene is seen; chosen: floor and heights can both be read
ELEVATION, TURNED = np.deg2rad(24), np.deg2rad(55)


def space(path: Path, cameras: Sequence[Camera], walks: Walks, pose: Pose | None) -> None:
    """Cameras as the pyramids that they see, the floor with its metres, walks and a pose, seen obliquely from above.

    `cameras`: `Camera`s with a pose; `walks`: sequence -> (N, 3) m; `pose`: (points (J, 3) m, joints) or None. A camera
    further than NEAR from the walks is an arrow with its distance.
    """
    walks = dict(sorted(walks.items()))
    middle = _middle(cameras, walks)
    near = [c for c in cameras if np.linalg.norm(c.centre - middle) <= NEAR]
    floor = _floor(near, walks, middle)
    view = _view(walks)
    figure, axis = new_figure(height=4.4)
    axis.set_aspect("equal")
    axis.axis("off")
    _draw_floor(axis, view, floor)
    colours = _walk_colours(walks)
    for name, walk in walks.items():
        axis.plot(*(walk * (1, 1, 0) @ view.T).T, color=EDGE, lw=0.8)
        axis.plot(*(walk @ view.T).T, color=colours[name], lw=1.2, alpha=0.85, label=name)
    if pose is not None:
        points, names = pose
        for a, b in skeletons.bones_of(names):
            axis.plot(*(points[[a, b]] @ view.T).T, color=DARK, lw=1)
    size = 0.09 * np.ptp(floor, axis=0).max()
    labels = [_draw_camera(axis, view, camera, size) for camera in near]
    labels += [_draw_far(axis, view, camera, middle, floor) for camera in cameras if camera not in near]
    axis.margins(0.06)
    _legend(figure, walks, colours)
    _apart(figure, labels)
    save_svg(figure, path)


def _apart(figure: "Figure", names: Sequence["Annotation"]) -> None:
    """Move names that would cover others before them to the first of PLACES around their points that is free."""
    from matplotlib.patheffects import withStroke

    figure.draw_without_rendering()
    # the sizes of the axes are known now; a name that moves must not change them
    figure.set_layout_engine(None)
    taken = [
        text.get_window_extent() for axis in figure.axes for text in axis.texts if text.get_text() and text not in names
    ]
    for name in names:
        name.set_in_layout(False)
        # readable on lines, too
        name.set_path_effects([withStroke(linewidth=2.5, foreground=WHITE)])
        first = name.get_position(), name.get_horizontalalignment(), name.get_verticalalignment()
        for place, ha, va in (first, *PLACES):
            name.set(position=place, ha=ha, va=va)
            box = name.get_window_extent().padded(2)
            if not box.count_overlaps(taken) and figure.bbox.containsx(box.x0) and figure.bbox.containsx(box.x1):
                break
        else:
            name.set(position=first[0], ha=first[1], va=first[2])
            box = name.get_window_extent()
        taken.append(box)


def _middle(cameras: Sequence[Camera], walks: Walks) -> Floats:
    walked = np.concatenate([*walks.values(), np.empty((0, 3))])
    walked = walked[np.isfinite(walked).all(axis=1)]
    return np.median(walked if len(walked) else [c.centre for c in cameras], axis=0)


def _floor(near: Sequence[Camera], walks: Walks, middle: Floats) -> Floats:
    """Lowest and highest x and y (2, 2) m, whole metres around what is near."""
    points = np.concatenate([middle[None], *(c.centre[None] for c in near), *walks.values()])[:, :2]
    return np.stack([np.floor(np.nanmin(points, axis=0) - 0.3), np.ceil(np.nanmax(points, axis=0) + 0.3)])


def _view(walks: Walks) -> Floats:
    """(2, 3): what is right and up on the page; the direction walked most lies a little off the page's horizontal."""
    points = np.concatenate([*walks.values(), np.empty((0, 3))])
    points = points[np.isfinite(points).all(axis=1)]
    azimuth = TURNED
    if len(points) > 1:
        along = np.linalg.svd(points[:, :2] - points[:, :2].mean(axis=0), full_matrices=False)[2][0]
        azimuth = np.arctan2(*(along * np.sign(along[np.abs(along).argmax()]))[::-1]) + np.pi / 2 - TURNED
    right = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    ahead = np.array([-right[1], right[0], 0.0])
    return np.stack([right, np.sin(ELEVATION) * ahead + np.cos(ELEVATION) * np.eye(3)[2]])


def _draw_floor(axis: "Axes", view: Floats, floor: Floats) -> None:
    """A grid on the floor, with metres at its two edges in front, and heights at its left corner."""
    (x0, y0), (x1, y1) = floor
    step = next(s for s in (1, 2, 5, 10, 20, 50) if np.ptp(floor, axis=0).max() / s <= 14 or s == 50)
    xs, ys = np.arange(x0, x1 + 1e-6), np.arange(y0, y1 + 1e-6)
    xs, ys = xs[xs % step == 0], ys[ys % step == 0]
    ends = [((x, y0, 0), (x, y1, 0)) for x in xs] + [((x0, y, 0), (x1, y, 0)) for y in ys]
    corners = [(x0, y0, 0), (x1, y0, 0), (x1, y1, 0), (x0, y1, 0), (x0, y0, 0)]
    for line in ends:
        axis.plot(*(np.array(line) @ view.T).T, color=GRID, lw=0.8, zorder=0)
    axis.plot(*(np.array(corners) @ view.T).T, color=EDGE, lw=1, zorder=0)
    # the edge in front is the one further down on the page
    front_y = y0 if view[1, 1] > 0 else y1
    front_x = x0 if view[1, 0] > 0 else x1
    every = 1 if max(len(xs), len(ys)) <= 9 else 2
    for at, name, points in (
        ((0.5 * (x0 + x1), front_y, 0), "x, m", [(x, front_y, 0) for x in xs[::every]]),
        ((front_x, 0.5 * (y0 + y1), 0), "y, m", [(front_x, y, 0) for y in ys[::every]]),
    ):
        side = "left" if (np.array(at) - [*floor.mean(axis=0), 0]) @ view[0] > 0 else "right"
        away = 5 if side == "left" else -5
        for point in points:
            axis.annotate(
                f"{point[0] if name[0] == 'x' else point[1]:.0f}", tuple(np.array(point) @ view.T), xytext=(away, -4),
                textcoords="offset points", fontsize=7.5, color=GREY, ha=side, va="top",
            )  # fmt: skip
        axis.annotate(name, tuple(np.array(at) @ view.T), xytext=(4 * away, -15), textcoords="offset points",
                      fontsize=8.5, color=DARK, ha=side, va="top")  # fmt: skip
    corner = min(corners, key=lambda c: np.array(c) @ view[0])
    heights = np.arange(0, 2.1)
    pole = np.array([(corner[0], corner[1], h) for h in heights])
    axis.plot(*(pole @ view.T).T, "_-", color=GREY, lw=1, ms=5)
    for point in pole[1:]:
        axis.annotate(f"{point[2]:.0f} m", point @ view.T, xytext=(-5, 0), textcoords="offset points", fontsize=7.5,
                      color=GREY, ha="right", va="center")  # fmt: skip


def _draw_camera(axis: "Axes", view: Floats, camera: Camera, size: float) -> "Annotation":
    lens = camera.intrinsics
    corners = np.array([(0, 0), (lens.width, 0), (lens.width, lens.height), (0, lens.height)], float)
    tips = camera.centre + rays(camera, corners) / (rays(camera, corners) @ camera.wRc[:, 2])[:, None] * size
    colour = ORANGE if camera.role == "long_range" else DARK
    centre, foot = camera.centre, camera.centre * (1, 1, 0)
    lines = [*((centre, tip) for tip in tips), *zip(tips, np.roll(tips, 1, axis=0), strict=True)]
    for line in lines:
        axis.plot(*(np.array(line) @ view.T).T, color=colour, lw=0.9)
    axis.plot(*(np.array([centre, foot]) @ view.T).T, color=colour, lw=0.8, ls=":")
    at = centre @ view.T
    axis.plot(*at, "o", ms=4, color=colour)
    return axis.annotate(
        camera.name, (at[0], at[1]), xytext=(0, 7), textcoords="offset points", fontsize=9, ha="center", color=colour
    )


def _draw_far(axis: "Axes", view: Floats, camera: Camera, middle: Floats, floor: Floats) -> "Annotation":
    """An arrow from the floor's edge towards a far camera; returns its name."""
    towards = (camera.centre - middle) * (1, 1, 0)
    distance = np.linalg.norm(camera.centre - middle)
    towards /= np.linalg.norm(towards)
    base = middle * (1, 1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = np.where(towards[:2] > 0, floor[1] - base[:2], floor[0] - base[:2]) / towards[:2]
    edge = base + towards * np.nanmin(np.where(np.abs(towards[:2]) > 1e-9, reach, np.nan))
    tip = edge + towards * 0.14 * np.ptp(floor, axis=0).max()
    edge, tip = edge @ view.T, tip @ view.T
    axis.annotate("", tip, edge, arrowprops={"arrowstyle": "-|>", "color": ORANGE, "lw": 1.6})
    axis.plot(*tip, alpha=0)
    down = tip[1] < edge[1]
    return axis.annotate(f"{camera.name}, {distance:.0f} m away", tip, xytext=(0, -4 if down else 4), color=ORANGE,
                  textcoords="offset points", fontsize=9, ha="right" if tip[0] > edge[0] else "left",
                  va="top" if down else "bottom")  # fmt: skip


def _walk_colours(walks: Walks) -> dict[str, str]:
    """Colours by walk; one for all where they are too many to name."""
    return colours_of(walks) if len(walks) <= NAMED else dict.fromkeys(walks, COLOURS[0])


def _legend(figure: "Figure", walks: Walks, colours: Mapping[str, str]) -> None:
    if not 0 < len(walks) <= NAMED:
        return
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=colours[name], label=name) for name in walks]
    figure.legend(handles=handles, loc="outside lower left", ncols=3, handlelength=1.2, columnspacing=1)


def plan(path: Path, cameras: Sequence[Camera], walks: Walks, pose: Pose | None) -> None:
    """Cameras and walks of a session from above and from the side; arguments as for `space`.

    The side view looks along the horizontal direction in which there is least to see.
    """
    walks = dict(sorted(walks.items()))
    middle = _middle(cameras, walks)
    near = [c for c in cameras if np.linalg.norm(c.centre - middle) <= NEAR]
    points = np.concatenate([middle[None], *(c.centre[None] for c in near), *walks.values()])
    points = points[np.isfinite(points).all(axis=1)]
    high, wide = np.ptp(points[:, 1]), np.ptp(points[:, 0])
    # the view from above has the same scale both ways
    top = float(np.clip(4.2 * max(high, 1) / max(wide, 1), 1.6, 4.2))
    figure, axes = new_figure(2, 1, height=1.6 + top + 1.7, height_ratios=(top, 1.7))
    names = _top(axes[0], near, [c for c in cameras if c not in near], walks, pose, points, middle)
    axes[0].set_title(f"from above, {len(cameras)} cameras, {len(walks)} walks")
    names += _side(axes[1], near, walks, pose, points)
    _apart(figure, names)
    save_svg(figure, path)


def _walks(axis: "Axes", walks: Walks, across: Floats, up: Floats) -> None:
    for name, colour in _walk_colours(walks).items():
        axis.plot(walks[name] @ across, walks[name] @ up, color=colour, lw=1.2, alpha=0.8)


def _cameras(axis: "Axes", cameras: Sequence[Camera], across: Floats, up: Floats, extent: float) -> list["Annotation"]:
    """Squares with their viewing directions; returns their names."""
    names = []
    for camera in cameras:
        centre, ahead = camera.centre, camera.wRc[:, 2]
        x, y = centre @ across, centre @ up
        direction = np.array([ahead @ across, ahead @ up]) * 0.12 * extent
        axis.annotate("", (x + direction[0], y + direction[1]), (x, y), arrowprops={"arrowstyle": "->", "color": GREY})
        axis.plot(x, y, "s", ms=6, color=ORANGE if camera.role == "long_range" else DARK)
        names.append(_named(axis, camera.name, np.array([x, y])))
    return names


def _named(axis: "Axes", text: str, at: Floats, colour: str = DARK) -> "Annotation":
    (place, ha, va), *_ = PLACES
    return axis.annotate(text, (at[0], at[1]), xytext=place, textcoords="offset points", fontsize=8.5, ha=ha, va=va,
                         color=colour)  # fmt: skip


def _pose(axis: "Axes", pose: Pose | None, across: Floats, up: Floats) -> None:
    if pose is None:
        return
    points, names = pose
    for a, b in skeletons.bones_of(names):
        axis.plot(points[[a, b]] @ across, points[[a, b]] @ up, color=DARK, lw=1)


def _top(
    axis: "Axes",
    near: Sequence[Camera],
    far: Sequence[Camera],
    walks: Walks,
    pose: Pose | None,
    points: Floats,
    middle: Floats,
) -> list["Annotation"]:
    """`points` (N, 3) m: what is near; there are arrows towards what is `far` from the `middle` of the walks, (3,) m.

    Returns the names of the cameras.
    """
    x, y = np.eye(3)[:2]
    _walks(axis, walks, x, y)
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    extent = max(float((high - low).max()), 1.0)
    names = _cameras(axis, near, x, y, extent)
    _pose(axis, pose, x, y)
    for camera in far:
        away = camera.centre - middle
        towards = away[:2] / np.linalg.norm(away[:2])
        start, tip = ((low + high) / 2 + towards * reach * extent for reach in (0.5, 0.68))
        axis.annotate("", tip, start, arrowprops={"arrowstyle": "-|>", "color": ORANGE, "lw": 1.6})
        axis.plot(*tip, alpha=0)
        text = f"{camera.name}, {np.linalg.norm(away):.0f} m away"
        names.append(_named(axis, text, tip, ORANGE))
    axis.set_aspect("equal", adjustable="box")
    axis.margins(0.12)
    axis.set_xlabel("x, m")
    axis.set_ylabel("y, m")
    return names


def _side(
    axis: "Axes", cameras: Sequence[Camera], walks: Walks, pose: Pose | None, points: Floats
) -> list["Annotation"]:
    """Along the direction in which `points` (N, 3) m are spread least. Returns the names of the cameras."""
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    across = np.append(np.linalg.svd(flat, full_matrices=False)[2][0], 0.0) if len(flat) > 1 else np.eye(3)[0]
    across = across * np.sign(across[np.abs(across).argmax()])
    up = np.eye(3)[2]
    _walks(axis, walks, across, up)
    names = _cameras(axis, cameras, across, up, 8.0)
    _pose(axis, pose, across, up)
    axis.axhline(0, color=GREY, lw=1)
    axis.margins(0.12)
    axis.set_ylim(min(-0.2, axis.get_ylim()[0]), max(2.2, axis.get_ylim()[1]))
    axis.set_title("from the side, heights stretched")
    axis.set_xlabel("along the walk, m")
    axis.set_ylabel("height, m")
    return names
