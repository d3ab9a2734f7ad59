"""The embedded world against a pinhole camera, a ray-plane intersection and renders with and without each object."""

import hashlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from fdslam.data.campus import View, World, contact_sheet
from fdslam.data.campus.camera import Camera
from fdslam.data.campus.changes import KINDS, Change
from fdslam.data.campus.raster import SS, Buffers, cover, paint, resolve
from fdslam.data.campus.route import LENGTH, SHIFT
from fdslam.data.campus.scene import GROUND, OBJECT, SKY, Quad, mesh
from fdslam.data.campus.texture import Texture, plain
from fdslam.data.campus.world import LEAST_AREA, LEAST_PIXELS

ARGUMENTS = (5, 10, 12, 96, 128)  # seed, map images, query images, width, height


@pytest.fixture(scope="module")
def world() -> World:
    return World(*ARGUMENTS)


@pytest.fixture(scope="module")
def queries(world: World) -> list[View]:
    return [world.view("query", i) for i in range(world.query_images)]


def digest(view: View) -> str:
    arrays = (view.image, view.labels, view.depth, view.boxes, np.array(view.pose))
    return hashlib.sha256(b"".join(a.tobytes() for a in arrays) + repr(view.kinds).encode()).hexdigest()


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


def test_the_same_bytes_in_any_process_thread_and_order(world, queries):
    code = (
        "from tests.data.test_campus import *; w = World(*ARGUMENTS)\n"
        "print(digest(w.view('query', 7)), digest(w.view('map', 3)), digest(w.view('query', 0)))"
    )
    root = Path(__file__).parents[2]
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root)
    other = run.stdout.split()
    assert other == [digest(queries[7]), digest(world.view("map", 3)), digest(queries[0])]
    with ThreadPoolExecutor(4) as pool:
        backwards = list(pool.map(lambda i: digest(world.view("query", i)), reversed(range(12))))
    assert backwards[::-1] == [digest(v) for v in queries]


def test_images_differ_by_seed_session_and_index(world, queries):
    views = [*queries, world.view("map", 0), World(6, *ARGUMENTS[1:]).view("map", 0)]
    assert len({digest(v) for v in views}) == len(views)


def test_a_box_is_what_changes_when_its_object_is_taken_away(world, queries):
    seen = 0
    for i, view in enumerate(queries):
        camera = world.camera("query", i)
        static = world.static("query", camera)
        changes, buffers = world.populate(i, camera, static)
        assert tuple(c.kind for c in changes) == view.kinds
        for k, box in enumerate(view.boxes):
            without = world.add(static, camera, changes[:k] + changes[k + 1 :])
            differs = (without.inverse != buffers.inverse).reshape(128, SS, 96, SS)
            rows, columns = np.nonzero(differs.any((1, 3)))
            assert box.tolist() == [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
            assert differs.sum() >= SS * SS * max(LEAST_PIXELS, LEAST_AREA * 96 * 128)
            assert (view.labels[differs.all((1, 3))] == OBJECT).all()
            seen += 1
    assert seen >= 8


def test_every_third_query_and_every_map_image_sees_no_change(world, queries):
    assert [i for i, v in enumerate(queries) if not len(v.boxes)] == [2, 5, 8, 11]
    assert all(len(v.boxes) == len(v.kinds) and set(v.kinds) <= set(KINDS) for v in queries)
    for i in (0, 2, 9):
        view = world.view("map", i)
        assert view.boxes.shape == (0, 4)
        assert view.kinds == ()


def test_a_distractor_shows_the_static_world_alone(world, queries):
    camera = world.camera("query", 2)
    alone = resolve(world.static("query", camera))
    np.testing.assert_array_equal(queries[2].depth, alone.depth)
    np.testing.assert_array_equal(queries[2].labels, alone.label)


def test_sky_is_infinitely_far_and_only_the_sky(queries):
    for view in queries:
        np.testing.assert_array_equal(view.labels == SKY, np.isinf(view.depth))
        assert (view.depth > 0).all()
    assert set(np.unique([v.labels for v in queries])) == {0, 1, 2, 3, 4}


def test_ground_depth_is_the_ray_plane_intersection(world, queries):
    for i in (0, 2, 4):
        camera, view = world.camera("query", i), queries[i]
        u, v = np.meshgrid(np.arange(96) + 0.5, np.arange(128) + 0.5)
        rays = np.stack([u, v, np.ones_like(u)], -1) @ np.linalg.inv(camera.matrix()).T @ camera.axes
        with np.errstate(divide="ignore"):
            depth = -camera.eye / rays[..., 2]
        _, buffers = world.populate(i, camera, world.static("query", camera))
        whole = (buffers.quad == 1).reshape(128, SS, 96, SS).all((1, 3))  # elsewhere only a part of the pixel is ground
        assert whole.sum() > 1000
        assert (view.labels[whole] == GROUND).all()
        np.testing.assert_allclose(view.depth[whole], depth[whole], rtol=1e-5)


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


def test_a_hidden_object_is_left_out(world):
    camera = Camera(96, 128, 0, 0, 0)
    near = Change("board", (upright(4, 1, -1, 0, 3),), np.array([4.0, 0]), 0)
    hidden = Change("person", (upright(6, 0.5, -0.5, 0, 1.8),), np.array([6.0, 0]), 0)
    beside = Change("person", (upright(6, -1.9, -2.6, 0, 1.8),), np.array([6.0, -2.2]), 0)
    peeping = Change("car", (upright(7, 1.95, -1, 0, 2),), np.array([7.0, 0]), 0)  # a tenth shows beside the board
    assert painted(camera, *near.quads, *peeping.quads).count(2)[1] > SS * SS * LEAST_PIXELS
    kept, buffers = world.keep(blank(camera), camera, [near, hidden, beside, peeping])
    assert kept == [near, beside]
    assert min(buffers.count(2)) > 0


def test_quads_through_the_near_plane_and_behind_it():
    camera = Camera(64, 96, 0, 0, 0)
    passing = Quad(np.array([-5.0, 1, 2]), np.array([15.0, 0, 0]), np.array([0, 0, -2.0]), plain((9, 9, 9)), OBJECT)
    behind = upright(-4, 1, -1, 0, 3)
    buffers = painted(camera, passing, behind)
    assert buffers.count(2)[1] == 0
    x0, _, x1, _ = buffers.boxes(1)[0]
    assert x0 == 0  # it runs out of the image on the left
    assert x1 - 1 <= pinhole(camera, (10, 1, 1))[0] <= x1
    with pytest.raises(ValueError, match="object 1"):
        buffers.boxes(2)


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


def test_poses_follow_the_path():
    world = World(1, 96, 72, 64, 96)
    maps = np.array([[c.x, c.y, c.heading] for c in (world.camera("map", i) for i in range(96))])
    steps = np.roll(maps, -1, axis=0)[:, :2] - maps[:, :2]
    assert np.linalg.norm(steps, axis=1).max() < LENGTH / 96 + 0.3
    turn = np.angle(np.exp(1j * (np.arctan2(steps[:, 1], steps[:, 0]) - maps[:, 2])))
    assert np.abs(turn).max() < np.deg2rad(15)
    away = []
    for i in range(72):
        camera = world.camera("query", i)
        away.append(np.hypot(*(maps[:, :2] - (camera.x, camera.y)).T).min())
    assert min(away) > 0.2
    assert max(away) < np.hypot(SHIFT, 1.6)
    assert world.route.distance(np.array([b.center for b in world.layout.buildings])).min() > 4


@pytest.mark.parametrize(("width", "height"), [(64, 96), (97, 65)])
def test_other_sizes(width, height):
    world = World(2, 3, 3, width, height)
    for view in (world.view("map", 2), world.view("query", 1)):
        assert view.image.shape == (height, width, 3)
        assert view.labels.shape == view.depth.shape == (height, width)
        assert (view.image.dtype, view.labels.dtype, view.depth.dtype) == (np.uint8, np.uint8, np.float32)
        assert view.boxes.dtype == np.float32
        assert (view.boxes >= 0).all()
        assert (view.boxes <= [width, height, width, height]).all()
    assert len(world.view("query", 1).boxes) > 0


def test_indices_out_of_range_and_the_contact_sheet(world):
    with pytest.raises(IndexError, match="there are 10"):
        world.view("map", 10)
    with pytest.raises(KeyError):
        world.view("night", 0)
    sheet = contact_sheet(world, "map", [0, 1, 2], columns=2)
    assert sheet.shape == (256, 192, 3)
    np.testing.assert_array_equal(sheet[128:, :96], world.view("map", 2).image)
