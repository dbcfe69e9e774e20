"""Cameras and points that several tests need."""

import numpy as np

from dior.geometry.camera import Camera, Intrinsics, pose
from dior.geometry.multiview import look_at

D455 = (-0.055, 0.064, -0.0006, 0.0006, -0.02)


def camera(name, centre, target=(0, 0, 1), fx=640.0, distortion=D455, model="plumb_bob", role="close"):
    """A D455-like camera that looks at a target."""
    lens = Intrinsics(1280, 720, fx, fx * 1.001, 642.3, 357.8, model, distortion)
    return Camera(name, lens, pose(look_at(centre, target), centre), role)


def ring(count=3, radius=5.0, height=1.5, **kwargs):
    """Cameras around the origin, all looking at it."""
    angles = 2 * np.pi * np.arange(count) / count + 0.3
    return [
        camera(f"cam{i + 1:02d}", (radius * np.cos(a), radius * np.sin(a), height), **kwargs)
        for i, a in enumerate(angles)
    ]
