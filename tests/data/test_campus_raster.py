"""Painted quads against a pinhole camera written out with sines and cosines."""

import numpy as np
import pytest

from fdslam.data.campus.camera import Camera
from fdslam.data.campus.raster import SS, Buffers, cover, paint
from fdslam.data.campus.scene import OBJECT, SKY, Quad, mesh
from fdslam.data.campus.texture import Texture, plain


def blank(camera: Camera) -> Buffers:
    shape = camera.height * SS, camera.width * SS
    return Buffers(np.zeros((*shape, 3), np.uint8), np.zeros(shape, np.float32), np.zeros(shape, np.int32), [SKY], [-1])


def upright(x: float, y0: float, y1: float, z0: float, z1: float, texture: Texture | None = None) -> Quad:
    """A quad across the view of a camera that looks along +x: its left edge at y0 > y1."""
    right, down = np.array([0, y1 - y0, 0.0]), np.array([0, 0, z0 - z1])
    return Quad(np.array([x, y0, z1]), right, down, texture or plain((200, 0, 0)), OBJECT)


def painted(camera: Camera, *quads: Quad) -> Buffers:
    buffers = blank(camera)
    for k, quad in enumerate(quads):
        paint(buffers, camera, mesh([quad], [k]), np.ones((1, 3)))
    return buffers


def pinhole(camera: Camera, point: tuple[float, float, float]) -> tuple[float, float, float]:
    """Pixel and depth of a world point, written out with sines and cosines."""
    dx, dy = point[0] - camera.x, point[1] - camera.y
    forward = dx * np.cos(camera.heading) + dy * np.sin(camera.heading)
    left = -dx * np.sin(camera.heading) + dy * np.cos(camera.heading)
    cx, cy = camera.center
    u = cx - camera.focal * left / forward
    return u, cy - camera.focal * (point[2] - camera.eye) / forward, forward


def test_a_quad_lands_where_a_pinhole_camera_puts_it():
    camera = Camera(160, 200, 3.0, -2.0, 0.4)
    ahead, left = np.array([np.cos(0.4), np.sin(0.4), 0]), np.array([-np.sin(0.4), np.cos(0.4), 0])
    corner = np.array([3.0, -2.0, 0]) + 7.3 * ahead + 1.1 * left + [0, 0, 2.6]
    quad = Quad(corner, -1.9 * left, np.array([0, 0, -1.3]), plain((9, 9, 9)), OBJECT)
    buffers = painted(camera, quad)
    x0, y0, depth = pinhole(camera, tuple(corner))
    x1, y1, _ = pinhole(camera, tuple(corner - 1.9 * left + [0, 0, -1.3]))
    rows, columns = np.nonzero(buffers.quad)
    extent = np.array([columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]) / SS
    np.testing.assert_allclose(extent, [x0, y0, x1, y1], atol=0.5 / SS + 1e-6)
    np.testing.assert_allclose(buffers.inverse[rows, columns], 1 / depth, rtol=1e-5)
    xy, z = camera.project(corner[None])
    np.testing.assert_allclose([*xy[0], z[0]], [x0, y0, depth])


def test_textures_are_upright_unmirrored_and_in_perspective():
    halves = np.zeros((64, 64, 3), np.uint8)
    halves[:, :32, 0], halves[:32, :, 2] = 255, 255
    camera = Camera(160, 200, 0, 0, 0)
    start, stop = np.array([3.0, 1.0, 3.0]), np.array([30.0, -1.0, 3.0])  # a wall that runs away from the viewer
    quad = Quad(start, stop - start, np.array([0, 0, -3.0]), Texture(lambda: halves), OBJECT, two_sided=True)
    buffers = painted(camera, quad)
    rows, columns = np.nonzero(buffers.quad)
    seen = buffers.color[rows, columns]
    middle = pinhole(camera, tuple((start + stop) / 2))[0] * SS
    aside = np.abs(columns + 0.5 - middle) > 2
    np.testing.assert_array_equal((seen[:, 0] > 128)[aside], (columns + 0.5 < middle)[aside])
    assert abs(middle - (columns.min() + columns.max()) / 2) > 10  # an affine map would fail
    (x0, y0, _), (x1, y1, _) = (pinhole(camera, (*p[:2], 1.5)) for p in (start, stop))  # half way up
    line = (y0 + (columns + 0.5 - x0 * SS) / SS * (y1 - y0) / (x1 - x0)) * SS
    aside = (np.abs(rows + 0.5 - line) > 0.6) & (columns < middle)
    np.testing.assert_array_equal((seen[:, 2] > 128)[aside], (rows + 0.5 < line)[aside])


def test_the_nearer_quad_hides_the_farther_in_either_order():
    camera = Camera(64, 64, 0, 0, 0)
    near, far = upright(4, 1, -1, 0, 3), upright(6, 1, -1, 0.5, 2.5)
    one, two = painted(camera, near, far), painted(camera, far, near)
    assert two.count(2)[0] == 0
    assert painted(camera, far).count(1)[0] > 0
    np.testing.assert_array_equal(one.inverse, two.inverse)


def test_quads_through_the_near_plane_and_behind_it():
    camera = Camera(64, 96, 0, 0, 0)
    passing = Quad(np.array([-5.0, 1, 2]), np.array([15.0, 0, 0]), np.array([0, 0, -2.0]), plain((9, 9, 9)), OBJECT)
    behind = upright(-4, 1, -1, 0, 3)
    buffers = painted(camera, passing, behind)
    assert buffers.count(2)[1] == 0
    x0, _, x1, _ = buffers.boxes([0])[0]
    assert x0 == 0  # it runs out of the image on the left
    assert x1 - 1 <= pinhole(camera, (10, 1, 1))[0] <= x1
    with pytest.raises(ValueError, match="object 1"):
        buffers.boxes([0, 1])


def test_cover_agrees_with_the_sign_of_every_edge():
    rng = np.random.default_rng(0)
    for _ in range(20):
        polygon = rng.uniform(2, 18, (3, 2))
        inside = np.ones((20, 20), bool)
        x, y = np.meshgrid(np.arange(20) + 0.5, np.arange(20) + 0.5)
        area = np.cross(np.append(polygon[1] - polygon[0], 0), np.append(polygon[2] - polygon[0], 0))[2]
        for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
            inside &= ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) * np.sign(area) >= 0
        np.testing.assert_array_equal(cover(polygon, 0, 20, 0, 20), inside)
        np.testing.assert_array_equal(cover(polygon[::-1], 0, 20, 0, 20), inside)
