"""The embedded world against rays and planes, and against renders with and without each object."""

import hashlib
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from fdslam.data.campus import SESSIONS, View, World
from fdslam.data.campus.camera import Camera
from fdslam.data.campus.objects import KINDS, Item
from fdslam.data.campus.raster import SS, resolve
from fdslam.data.campus.route import LENGTH, SHIFT, route, sideways
from fdslam.data.campus.scene import GROUND, OBJECT, SKY, Quad
from fdslam.data.campus.sheet import contact_sheet
from fdslam.data.campus.world import LEAST_AREA, LEAST_PIXELS
from tests.data.test_campus_raster import blank, upright

ARGUMENTS = (5, 88, 96, 128)  # seed, images, width, height
SHOWN = [(session, i) for session in SESSIONS for i in range(0, 22, 3)]


@pytest.fixture(scope="module")
def world():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "fdslam.data.campus.world.KEPT", len(SESSIONS)
        )  # the tests go through all sessions again and again
        yield World(*ARGUMENTS)


@pytest.fixture(scope="module")
def views(world: World) -> dict[tuple[str, int], View]:
    return {which: world.view(*which) for which in SHOWN}


def digest(view: View) -> str:
    arrays = (view.image, view.labels, view.depth, view.items, view.boxes, view.clear, np.array(view.pose))
    return hashlib.sha256(b"".join(a.tobytes() for a in arrays)).hexdigest()


def test_the_same_bytes_in_any_process_thread_and_order(world, views):
    code = (
        "from tests.data.test_campus import *; w = World(*ARGUMENTS)\n"
        "print(digest(w.view('AU', 3)), digest(w.view('WI', 6)), digest(w.view('AU', 0)))"
    )
    root = Path(__file__).parents[2]
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=root)
    assert run.stdout.split() == [digest(views[which]) for which in (("AU", 3), ("WI", 6), ("AU", 0))]
    with ThreadPoolExecutor(4) as pool:
        backwards = list(pool.map(lambda which: digest(world.view(*which)), reversed(SHOWN[5:11])))
    assert backwards[::-1] == [digest(views[which]) for which in SHOWN[5:11]]


def test_images_differ_by_seed_session_and_index(views):
    everything = [*views.values(), World(6, *ARGUMENTS[1:]).view("WI", 0)]
    assert len({digest(v) for v in everything}) == len(everything)


def test_a_box_is_what_changes_when_its_object_is_taken_away(world, views):
    seen = 0
    for (session, i), view in views.items():
        camera = world.camera(session, i)
        static = world.static(session, camera)
        buffers, clear = world.populate(session, camera, static)
        assert clear == dict(zip(view.items.tolist(), view.clear.tolist(), strict=True))
        for k, box, enough in zip(view.items.tolist(), view.boxes, view.clear, strict=True):
            without = static.copy()
            world.add(without, camera, session, [other for other in world.standing(session) if other != k])
            differs = (without.inverse != buffers.inverse).reshape(128, SS, 96, SS)
            rows, columns = np.nonzero(differs.any((1, 3)))
            assert box.tolist() == [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
            assert (view.labels[differs.all((1, 3))] == OBJECT).all()
            assert not enough or differs.sum() >= SS * SS * max(LEAST_PIXELS, LEAST_AREA * 96 * 128)
            seen += enough
    assert seen >= 20


def test_objects_stand_in_some_sessions_and_never_in_all(world):
    for seed in (0, 4):
        items = World(seed, 4, 64, 64).items
        assert {item.kind for item in items} == set(KINDS)
        assert {len(item.sessions) for item in items} == {1, 2, 3}
        assert all(item.sessions < set(SESSIONS) for item in items)
        assert all(len(item.sessions) == 1 for item in items if item.turns)


def test_only_what_stands_in_a_session_is_seen_there(world, views):
    for (session, _), view in views.items():
        assert all(session in world.items[k].sessions for k in view.items)
        for other in SESSIONS:
            expected = [other not in world.items[k].sessions for k in view.items]
            assert world.changes(view, other).tolist() == expected
            assert not any(expected) or other != session


def test_objects_stand_indoors_and_outdoors(world):
    inside = [bool(world.layout.passage.inside(item.at, -0.2)) for item in world.items]
    assert 2 < sum(inside) < len(inside) - 20
    for item, within in zip(world.items, inside, strict=True):
        assert all(quad.indoor == within for quad in item.quads)


def test_objects_leave_the_robot_its_way(world):
    along = np.arange(0, LENGTH, 0.3)
    for item in world.items:
        for session in item.sessions if item.radius else ():
            walk = world.route.beside(along, sideways(world.seed, session, along))
            assert np.linalg.norm(walk - item.at, axis=1).min() > item.radius + 0.4


def test_without_objects_in_sight_the_static_world_alone_is_shown(world, views):
    quiet = [which for which, view in views.items() if not len(view.items)]
    assert len(quiet) >= 3
    for which in quiet:
        alone = resolve(world.static(which[0], world.camera(*which)))
        np.testing.assert_array_equal(views[which].depth, alone.depth)
        np.testing.assert_array_equal(views[which].labels, alone.label)


def test_sky_is_infinitely_far_and_only_the_sky(views):
    for view in views.values():
        np.testing.assert_array_equal(view.labels == SKY, np.isinf(view.depth))
        assert (view.depth > 0).all()
    assert set(np.unique([v.labels for v in views.values()])) == {0, 1, 2, 3, 4}


def test_ground_depth_is_the_ray_plane_intersection(world, views):
    for which in (("WI", 0), ("SU", 18), ("AU", 21)):
        camera, view = world.camera(*which), views[which]
        u, v = np.meshgrid(np.arange(96) + 0.5, np.arange(128) + 0.5)
        rays = np.stack([u, v, np.ones_like(u)], -1) @ np.linalg.inv(camera.matrix()).T @ camera.axes
        with np.errstate(divide="ignore"):
            depth = -camera.eye / rays[..., 2]
        buffers, _ = world.populate(which[0], camera, world.static(which[0], camera))
        whole = (buffers.quad == 1).reshape(128, SS, 96, SS).all((1, 3))  # elsewhere only a part of the pixel is ground
        assert whole.sum() > 800
        assert (view.labels[whole] == GROUND).all()
        np.testing.assert_allclose(view.depth[whole], depth[whole], rtol=1e-5)


def indoors(world: World, session: str) -> list[Camera]:
    cameras = (world.camera(session, i) for i in range(world.count[session]))
    return [c for c in cameras if world.layout.passage.inside(c.position[:2], 0.6)]


def test_the_passage_closes_on_all_sides_and_opens_at_its_end(world):
    p = world.layout.passage
    for session in ("WI", "AU"):
        cameras = indoors(world, session)
        assert len(cameras) >= 8
        for camera in cameras[::4]:
            seen = resolve(world.static(session, camera))
            u, v = np.meshgrid(np.arange(96) + 0.5, np.arange(128) + 0.5)
            rays = np.stack([u, v, np.ones_like(u)], -1) @ np.linalg.inv(camera.matrix()).T @ camera.axes
            # Where a ray would leave the corridor, walls, floor and ceiling being planes.
            with np.errstate(divide="ignore"):
                up = np.where(rays[..., 2] > 0, p.height - camera.eye, -camera.eye) / rays[..., 2]
                aside = (
                    np.where(rays[..., 1] > 0, p.middle + p.half - camera.y, p.middle - p.half - camera.y)
                    / rays[..., 1]
                )
                ahead = (p.east - camera.x) / rays[..., 0]
            leaves = np.minimum(up, aside)
            closed = (leaves < 0.98 * ahead) & (rays[..., 0] > 0)
            assert closed.mean() > 0.5
            assert not (seen.label[closed] == SKY).any()
            assert (seen.depth[closed] <= leaves[closed] * 1.02 + 0.05).all()  # the floor lies a centimetre high


def test_the_path_leads_through_the_passage_without_a_step(world):
    """Small moves over both thresholds change the picture little: nothing appears or vanishes there."""
    p = world.layout.passage
    for x in (p.west, p.east):
        shots = []
        for step in (-0.03, -0.01, 0.01, 0.03):
            camera = Camera(96, 128, x + step, p.middle + 0.2, 0.1)
            shots.append(resolve(world.static("SP", camera)).color.astype(float))
        jumps = [np.abs(a - b).mean() for a, b in pairwise(shots)]
        assert jumps[1] < 2 * max(jumps[0], jumps[2]) + 1


def test_a_hidden_object_is_not_annotated(world):
    camera = Camera(96, 128, 0, 0, 0)

    def item(quad: Quad) -> Item:
        return Item("board", (quad,), np.array([6.0, 0]), 0.5, False, frozenset(["SU"]))

    near, hidden = item(upright(4, 1, -1, 0, 3)), item(upright(6, 0.5, -0.5, 0, 1.8))
    beside, peeping = item(upright(6, -1.9, -2.6, 0, 1.8)), item(upright(7, 1.95, -1, 0, 2))  # a tenth is to be seen
    tiny = item(upright(20, 8.0, 7.4, 2.0, 2.6))
    other = World(*ARGUMENTS)
    other.items = (near, hidden, beside, peeping, tiny, replace(near, sessions=frozenset(["WI"])))
    buffers, clear = other.populate("SU", camera, blank(camera))
    assert clear == {0: True, 2: True, 3: False, 4: False}
    assert buffers.count(6)[3] > SS * SS * LEAST_PIXELS  # enough pixels, but too small a share of it
    assert buffers.count(6)[1] == buffers.count(6)[5] == 0


def test_a_person_is_seen_from_the_front_wherever_the_camera_stands(world):
    person = next(item for item in world.items if item.turns)
    for angle in (0.0, 1.0, 2.5, 4.0):
        away = 5 * np.array([np.cos(angle), np.sin(angle)])
        camera = Camera(96, 128, *(person.at + away), float(angle + np.pi))
        [quad] = person.seen_from(camera)
        normal = np.cross(quad.down, quad.right)
        np.testing.assert_allclose(normal[:2] / np.linalg.norm(normal), away / 5, atol=1e-6)
        np.testing.assert_allclose((quad.origin + quad.right / 2)[:2], person.at, atol=1e-6)


def test_every_session_walks_the_loop_on_a_path_of_its_own():
    world = World(1, 384, 64, 96)
    centre = [b.center for b in world.layout.buildings[1:]]
    assert world.route.distance(np.array(centre)).min() > 4
    places = {}
    for session in SESSIONS:
        at = np.array([[c.x, c.y, c.heading] for c in (world.camera(session, i) for i in range(96))])
        steps = np.roll(at, -1, axis=0)[:, :2] - at[:, :2]
        assert np.linalg.norm(steps, axis=1).max() < LENGTH / 96 * 2
        turn = np.angle(np.exp(1j * (np.arctan2(steps[:, 1], steps[:, 0]) - at[:, 2])))
        assert np.abs(turn).max() < np.deg2rad(25)
        aside = world.route.distance(at[:, :2])
        assert 0.5 < aside.max() < SHIFT + 0.1
        places[session] = at
    for a in SESSIONS:
        for b in SESSIONS:
            nearest = np.linalg.norm(places[a][:, None, :2] - places[b][None, :, :2], axis=2).min(1)
            assert (nearest.max() < 3.5) if a != b else (nearest.max() == 0)
    assert 10 < np.mean([world.layout.passage.inside(at[:, :2]).sum() for at in places.values()]) < 14


def test_the_path_turns_smoothly_and_closes():
    for seed in range(3):
        way = route(seed)
        steps = np.linalg.norm(np.roll(way.points, -1, axis=0) - way.points, axis=1)
        np.testing.assert_allclose(steps, 0.25, rtol=1e-3)
        heading = way.heading(np.arange(0, LENGTH, 0.5))
        assert np.abs(np.angle(np.exp(1j * np.diff(heading, append=heading[:1])))).max() < 0.1


@pytest.mark.parametrize(("width", "height"), [(64, 96), (97, 65)])
def test_other_sizes(width, height):
    world = World(2, 8, width, height)
    for view in (world.view("SP", 1), world.view("SP", 0)):
        assert view.image.shape == (height, width, 3)
        assert view.labels.shape == view.depth.shape == (height, width)
        assert (view.image.dtype, view.labels.dtype, view.depth.dtype) == (np.uint8, np.uint8, np.float32)
        assert (view.boxes.dtype, view.items.dtype, view.clear.dtype) == (np.float32, np.int64, bool)
        assert (view.boxes >= 0).all()
        assert (view.boxes <= [width, height, width, height]).all()


def test_the_seasons_look_their_part(world, views):
    def mean(session: str, label: int) -> np.ndarray:
        outdoors = [views[which] for which in SHOWN if which[0] == session and which[1] in (0, 18, 21)]
        return np.concatenate([v.image[v.labels == label] for v in outdoors]).mean(0)

    ground = {name: mean(name, GROUND) for name in SESSIONS}
    assert ground["WI"].min() > max(ground[name].max() for name in ("SP", "SU", "AU"))  # snow is brighter than all else
    assert ground["WI"][2] >= ground["WI"][0]
    assert ground["SU"][1] > ground["SU"][2]  # grass
    leaves = {name: mean(name, 3) for name in SESSIONS}
    assert leaves["SU"][1] > leaves["SU"][0] * 1.1
    assert leaves["AU"][0] > leaves["AU"][1] * 1.1


def test_indices_out_of_range_and_the_contact_sheet(world, views):
    with pytest.raises(IndexError, match="there are 22"):
        world.view("SU", 22)
    with pytest.raises(KeyError):
        world.view("night", 0)
    sheet = contact_sheet(world, [("SU", 0), ("SU", 3), ("WI", 6)], columns=2, against=None)
    assert sheet.shape == (256, 192, 3)
    np.testing.assert_array_equal(sheet[128:, :96], views["WI", 6].image)
