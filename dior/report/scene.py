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
from dior.report.colours import COLOURS, DARK, EDGE, GREY, GRID, ORANGE, colours_of
from dior.report.plots import new_figure, save_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# by sequence, (N, 3) m
Walks: TypeAlias = Mapping[str, Floats]
# points (J, 3) m and the names of their joints
Pose: TypeAlias = tuple[Floats, list[str]]
# a camera further than this from the walks is only pointed at, m; chosen: close cameras are within 10, far ones at 60
NEAR = 20.0
# of a walk; chosen: a curve looks smooth, the file stays small
POINTS = 240
# walks beyond this many have no names beside them; chosen: as many as four rows of the legend hold
NAMED = 12
# from where the scene is seen; chosen: floor and heights can both be read
ELEVATION, TURNED = np.deg2rad(24), np.deg2rad(55)


def space(path: Path, cameras: Sequence[Camera], walks: Walks, pose: Pose | None) -> None:
    """Cameras as the pyramids that they see, the floor with its metres, walks and a pose, seen obliquely from above.

    `cameras`: `Camera`s with a pose; `walks`: sequence -> (N, 3) m; `pose`: (points (J, 3) m, joints) or None. A camera
    further than NEAR from the walks is an arrow with its distance.
    """
    walks = _thinned(walks)
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
    for camera in near:
        _draw_camera(axis, view, camera, size)
    for camera in cameras:
        if camera not in near:
            _draw_far(axis, view, camera, middle, floor)
    axis.margins(0.06)
    _legend(figure, walks, colours)
    save_svg(figure, path)


def _thinned(walks: Walks) -> dict[str, Floats]:
    """At most POINTS of the points of each walk, so that a long session is as small as a short one."""
    return {name: walk[:: max(1, len(walk) // POINTS)] for name, walk in sorted(walks.items())}


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
                      fontsize=8.5, color="#5a606a", ha=side, va="top")  # fmt: skip
    corner = min(corners, key=lambda c: np.array(c) @ view[0])
    heights = np.arange(0, 2.1)
    pole = np.array([(corner[0], corner[1], h) for h in heights])
    axis.plot(*(pole @ view.T).T, "_-", color=GREY, lw=1, ms=5)
    for point in pole[1:]:
        axis.annotate(f"{point[2]:.0f} m", point @ view.T, xytext=(-5, 0), textcoords="offset points", fontsize=7.5,
                      color=GREY, ha="right", va="center")  # fmt: skip


def _draw_camera(axis: "Axes", view: Floats, camera: Camera, size: float) -> None:
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
    axis.annotate(
        camera.name, (at[0], at[1]), xytext=(0, 7), textcoords="offset points", fontsize=9, ha="center", color=colour
    )


def _draw_far(axis: "Axes", view: Floats, camera: Camera, middle: Floats, floor: Floats) -> None:
    """An arrow from the floor's edge towards a far camera."""
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
    axis.annotate(f"{camera.name}, {distance:.0f} m away", tip, xytext=(0, -4 if down else 4), color=ORANGE,
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
    walks = _thinned(walks)
    everything = np.concatenate([np.array([c.centre for c in cameras]).reshape(-1, 3), *walks.values()])
    everything = everything[np.isfinite(everything).all(axis=1)]
    walked = np.concatenate([*walks.values(), np.empty((0, 3))])
    walked = walked[np.isfinite(walked).all(axis=1)]
    far = len(walked) and np.ptp(everything[:, :2], axis=0).max() > 4 * max(np.ptp(walked[:, :2], axis=0).max(), 3)
    panels = 3 if far else 2
    figure, axes = new_figure(panels, 1, height=2.4 + 2.6 * (panels - 1), squeeze=False)
    axes = axes[:, 0]
    _top(axes[0], cameras, walks, None)
    axes[0].set_title(f"from above, {len(cameras)} cameras, {len(walks)} walks")
    if far:
        near = [c for c in cameras if np.abs(c.centre[:2] - np.median(walked[:, :2], axis=0)).max() < NEAR]
        _top(axes[1], near, walks, pose)
        axes[1].set_title("from above, without the far camera")
    _side(axes[-1], cameras if not far else near, walks, pose, everything if not far else walked)
    _legend(figure, walks, _walk_colours(walks))
    save_svg(figure, path)


def _walks(axis: "Axes", walks: Walks, across: Floats, up: Floats) -> None:
    for name, colour in _walk_colours(walks).items():
        axis.plot(walks[name] @ across, walks[name] @ up, color=colour, lw=1.2, alpha=0.8)


def _cameras(axis: "Axes", cameras: Sequence[Camera], across: Floats, up: Floats, extent: float) -> None:
    for camera in cameras:
        centre, ahead = camera.centre, camera.wRc[:, 2]
        x, y = centre @ across, centre @ up
        direction = np.array([ahead @ across, ahead @ up]) * 0.12 * extent
        axis.annotate("", (x + direction[0], y + direction[1]), (x, y), arrowprops={"arrowstyle": "->", "color": GREY})
        long_range = camera.role == "long_range"
        axis.plot(x, y, "s", ms=6, color=ORANGE if long_range else DARK)
        axis.annotate(camera.name, (x, y), xytext=(0, 7), textcoords="offset points", fontsize=8.5, ha="center")


def _pose(axis: "Axes", pose: Pose | None, across: Floats, up: Floats) -> None:
    if pose is None:
        return
    points, names = pose
    for a, b in skeletons.bones_of(names):
        axis.plot(points[[a, b]] @ across, points[[a, b]] @ up, color=DARK, lw=1)


def _top(axis: "Axes", cameras: Sequence[Camera], walks: Walks, pose: Pose | None) -> None:
    x, y = np.eye(3)[:2]
    _walks(axis, walks, x, y)
    spread = [np.array([c.centre for c in cameras]).reshape(-1, 3), *walks.values()]
    extent = np.nanmax(np.ptp(np.concatenate(spread)[:, :2], axis=0), initial=1.0) if len(cameras) else 5.0
    _cameras(axis, cameras, x, y, extent)
    _pose(axis, pose, x, y)
    axis.set_aspect("equal", adjustable="datalim")
    axis.margins(0.1)
    axis.set_xlabel("x, m")
    axis.set_ylabel("y, m")


def _side(axis: "Axes", cameras: Sequence[Camera], walks: Walks, pose: Pose | None, points: Floats) -> None:
    flat = points[:, :2] - points[:, :2].mean(axis=0)
    across = np.append(np.linalg.svd(flat, full_matrices=False)[2][0], 0.0) if len(flat) > 1 else np.eye(3)[0]
    across = across * np.sign(across[np.abs(across).argmax()])
    up = np.eye(3)[2]
    _walks(axis, walks, across, up)
    _cameras(axis, cameras, across, up, 8.0)
    _pose(axis, pose, across, up)
    axis.axhline(0, color=GREY, lw=1)
    axis.margins(0.12)
    axis.set_ylim(min(-0.2, axis.get_ylim()[0]), max(2.2, axis.get_ylim()[1]))
    axis.set_title("from the side, heights stretched")
    axis.set_xlabel("along the walk, m")
    axis.set_ylabel("height, m")
