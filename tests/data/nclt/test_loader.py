"""A made-up pair of sessions, whole and with every fault that a download has."""

import itertools
import json
import shutil

import numpy as np
import pytest
from PIL import Image

from experiments.table1.campus_as_nclt import Shot, utime, write_session
from fdslam.config import Nclt
from fdslam.data import load_datasets
from fdslam.data.images import read_image
from fdslam.errors import InputError
from fdslam.store import Store
from tests.data.nclt.made_up import BOX, MAP, QUERY, annotations, change, image, made_up, poses, shots
from tests.data.worlds import texture

AUTUMN = {"query": "AU", "map": "SU"}


@pytest.fixture
def root(tmp_path):
    return made_up(tmp_path / "nclt")


@pytest.fixture
def load(root, tmp_path):
    def load(**changes):
        settings = Nclt(root=str(root), **({**AUTUMN, "every": 0.0} | changes))
        return load_datasets(settings, Store(tmp_path / "store"), 1)

    return load


def stamps(frames):
    return [int(frame.name.rsplit("/", 1)[1].split(".")[0]) for frame in frames]


def test_reads_everything(load):
    [data] = load()
    assert (data.name, data.pair) == ("nclt", ("AU", "SU"))
    assert [f.name for f in data.map] == [f"{MAP}/lb3/Cam5/{utime(MAP, i)}.tiff" for i in range(6)]
    assert stamps(data.query) == [utime(QUERY, i) for i in range(6)]
    assert [boxes.tolist() for boxes in data.boxes] == [[], [BOX], [], [BOX], [], []]
    assert [places.tolist() for places in data.relevant] == [[i] for i in range(6)]
    assert data.poses.tolist() == [[10.0 * i, 0, 0] for i in range(6)]
    assert data.times.tolist() == [0, 1, 2, 3, 4, 5]
    assert data.labels is None
    for i, frame in enumerate(data.map):
        np.testing.assert_array_equal(read_image(frame.path), texture(i, 160, 120))


def test_all_ordered_pairs_share_their_frames(root, load):
    write_session(root, "2013-01-10", dict(enumerate(shots(4))))
    data = load(query="all", map="all", sessions=["SU", "AU", "2013-01-10"])
    sessions = ("SU", "AU", "2013-01-10")
    again = load(all_pairs=True, query="", map="", sessions=["SU", "AU", "2013-01-10"])
    assert [(one.pair, one.query, one.map) for one in again] == [(one.pair, one.query, one.map) for one in data]
    assert [one.pair for one in data] == list(itertools.permutations(sessions, 2))
    assert data[0].map == data[2].query == data[3].query
    assert data[1].map == data[4].query
    assert [one.boxes is not None for one in data] == [False, False, True, False, False, False]
    names = [frame.name for frame in (*data[0].map, *data[0].query, *data[1].map)]
    assert len(set(names)) == len(names) == 16


def test_what_is_not_listed_is_no_query(root, load):
    change(root, lambda coco: coco.update(images=coco["images"][1:4]))
    [data] = load(every=25.0)  # which thins the map, and not what was annotated
    assert stamps(data.query) == [utime(QUERY, i) for i in (1, 2, 3)]
    assert stamps(data.map) == [utime(MAP, i) for i in (0, 3)]
    assert [places.tolist() for places in data.relevant] == [[], [], [1]]
    assert data.times.tolist() == [0, 3]


def test_without_annotations_the_sampled_images_are_the_queries(root, load):
    shutil.rmtree(root / "annotations")
    [data] = load(seconds=2.0)
    assert data.boxes is None
    assert stamps(data.query) == [utime(QUERY, i) for i in (0, 2, 4)]


def test_images_without_a_pose_are_left_out_and_counted_in_one_line(root, load, caplog):
    lines = poses(root, MAP).read_text().splitlines()
    lines[2] = lines[2].split(",")[0] + ",NaN" * 6  # between two poses 2 s apart
    poses(root, MAP).write_text("\n".join(lines))
    poses(root, QUERY).write_text("".join(poses(root, QUERY).read_text().splitlines(keepends=True)[2:]))
    shutil.copy(image(root, MAP, 4), image(root, MAP, 4).with_suffix(".tif"))
    shutil.copy(image(root, MAP, 4), image(root, MAP, 4).with_name("fourth.tiff"))
    [data] = load()
    assert stamps(data.map) == [utime(MAP, i) for i in (0, 1, 3, 4, 5)]
    assert stamps(data.query) == [utime(QUERY, i) for i in (2, 3, 4, 5)]
    left_out = [record.message for record in caplog.records if record.message.startswith("left out")]
    assert left_out == [
        f"left out: 2 of 6 images of {QUERY} without a pose; 1 of 6 images of {MAP} without a pose, 1 with a time "
        "stamp that was there already, 1 not named UTIME.tiff (poses up to 1 s apart are bridged, dataset.gap)"
    ]
    assert f"{QUERY}_{MAP}.json: 2 of 6 queries have no pose and are left out" in caplog.text
    [data] = load(gap=2.0)
    assert data.poses[2].tolist() == [20, 0, 0]


def test_a_map_by_distance_follows_the_path(root, load):
    [data] = load(every=20.0)
    assert data.poses[:, 0].tolist() == [0, 20, 40]


def test_the_camera_is_a_choice(root, load):
    with pytest.raises(InputError, match=r"Cam0: no such camera; choose dataset\.camera=Cam5"):
        load(camera="Cam0")
    for date in (MAP, QUERY):
        shutil.copytree(root / date / "lb3" / "Cam5", root / date / "lb3" / "Cam0")
    with pytest.raises(InputError, match=r"lists .*Cam5/.*which is no image of .*Cam0"):
        load(camera="Cam0")  # the annotations say which camera they are of
    annotations(root).unlink()
    assert load(camera="Cam0")[0].map[0].name == f"{MAP}/lb3/Cam0/{utime(MAP, 0)}.tiff"


def _half(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


FAULTS = {
    "half-written image": (lambda root: _half(image(root, MAP, 2)), r"\.tiff: damaged image"),
    "empty image": (lambda root: image(root, QUERY, 0).write_bytes(b""), r"\.tiff: not an image"),
    "upright image": (
        lambda root: Image.fromarray(texture(0, 160, 120)).save(image(root, MAP, 0)),
        "is upright already",
    ),
    "empty poses": (lambda root: poses(root, MAP).write_text(""), r"groundtruth_2012-08-04\.csv: holds no pose"),
    "text for poses": (
        lambda root: poses(root, QUERY).write_text("<html>404</html>\n"),
        r"groundtruth_2012-11-17\.csv, line 1",
    ),
    "poses of another session": (
        lambda root: shutil.copy(poses(root, MAP), poses(root, QUERY)),
        "has a pose for none of the 6 images",
    ),
    "no poses": (lambda root: poses(root, QUERY).unlink(), r"groundtruth_2012-11-17\.csv: no such file"),
    "no session": (lambda root: shutil.rmtree(root / MAP), "2012-08-04/lb3: no such session"),
    "annotations of the other direction": (
        lambda root: change(root, lambda coco: coco["images"][0].update(file_name=f"{utime(MAP, 0)}.tiff")),
        "which is no image of 2012-11-17",
    ),
    "annotations that are none": (
        lambda root: annotations(root).write_text(json.dumps({"images": 3})),
        r"2012-11-17_2012-08-04\.json: not COCO",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_one_line_that_names_the_file(root, load, fault):
    spoil, said = FAULTS[fault]
    spoil(root)
    with pytest.raises(InputError, match=said) as error:
        load()
    assert "\n" not in str(error.value)


def test_annotations_of_images_without_a_pose_alone(root, load):
    change(root, lambda coco: coco.update(images=coco["images"][:1], annotations=[]))
    poses(root, QUERY).write_text("".join(poses(root, QUERY).read_text().splitlines(keepends=True)[2:]))
    with pytest.raises(InputError, match="none of its images has a pose"):
        load()


def test_headings_decide_what_shows_the_same_place(root, load):
    back = [Shot(shot.image, (shot.pose[0], 0.0, np.pi), shot.boxes) for shot in shots()]
    shutil.rmtree(root / MAP)
    write_session(root, MAP, dict(enumerate(back)))
    [data] = load()
    assert all(len(places) == 0 for places in data.relevant)
    [data] = load(angle=180.0)
    assert [places.tolist() for places in data.relevant] == [[i] for i in range(6)]
