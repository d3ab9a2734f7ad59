import shutil

import numpy as np
import pytest

from fdslam.config import Nclt
from fdslam.data.nclt.layout import check_nclt, image_folder, pose_file, read_session, table_file
from fdslam.errors import InputError

DATE = "2012-08-04"


def laid(root, *files):
    for file in files:
        path = root / file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"")
    return root


def settings(root, **changes):
    return Nclt(root=str(root), query="AU", map="SU", **changes)


@pytest.fixture
def root(tmp_path):
    dates = (DATE, "2012-11-17")
    return laid(
        tmp_path, *(f"{d}/lb3/Cam5/1.tiff" for d in dates), *(f"ground_truth/groundtruth_{d}.csv" for d in dates)
    )


@pytest.mark.parametrize(
    "place",
    ["{0}", "images/{0}", "{0}_lb3/{0}", "images/{0}_lb3/{0}", "{0}_lb3", "images/{0}_lb3"],
)
def test_images_are_found_where_people_unpack_them(tmp_path, place):
    folder = place.format(DATE) + "/lb3/Cam5"
    laid(tmp_path, f"{folder}/17.tiff")
    assert image_folder(tmp_path, DATE, "Cam5") == tmp_path / folder


@pytest.mark.parametrize("place", ["ground_truth", ".", DATE, f"images/{DATE}"])
def test_poses_are_found(tmp_path, place):
    laid(tmp_path, f"{place}/groundtruth_{DATE}.csv")
    assert pose_file(tmp_path, DATE) == tmp_path / place / f"groundtruth_{DATE}.csv"


def test_images_are_in_the_order_of_their_stamps_and_none_is_there_twice(tmp_path):
    names = ["1000.tiff", "999.tiff", "0999.tif", "1000.TIFF", "5.tiff.partial", "notes.txt", "x7.tiff", "5.png"]
    laid(tmp_path, *(f"{DATE}/lb3/Cam5/{name}" for name in names))
    session = read_session(tmp_path, DATE, "Cam5")
    assert session.utimes.tolist() == [999, 1000]
    assert session.utimes.dtype == np.int64
    assert (session.files, session.repeated, session.misnamed) == (("0999.tif", "1000.TIFF"), 2, 1)
    assert session.name(1) == f"{DATE}/lb3/Cam5/1000.TIFF"


def test_what_is_complete_passes(root):
    check_nclt(settings(root))


def test_a_missing_root_session_camera_image_or_pose_file_is_named(root):
    with pytest.raises(InputError, match=r"dataset\.root=/nowhere: no such folder"):
        check_nclt(settings("/nowhere"))
    with pytest.raises(InputError, match=r"Cam3: no such camera; choose dataset\.camera=Cam5 or .*--camera Cam3"):
        check_nclt(settings(root, camera="Cam3"))
    (root / "ground_truth" / f"groundtruth_{DATE}.csv").unlink()
    with pytest.raises(InputError, match=rf"groundtruth_{DATE}\.csv: no such file .*fetch nclt --session {DATE} --to"):
        check_nclt(settings(root))
    (root / DATE / "lb3" / "Cam5" / "1.tiff").rename(root / DATE / "lb3" / "Cam5" / "first.tiff")
    with pytest.raises(InputError, match="Cam5: holds no image named UTIME"):
        check_nclt(settings(root))
    shutil.rmtree(root / DATE)
    with pytest.raises(InputError, match=rf"{DATE}/lb3: no such session .*fetch nclt --session {DATE} --to"):
        check_nclt(settings(root))


def test_images_in_two_places_are_not_guessed_between(root):
    laid(root, f"images/{DATE}/lb3/Cam5/notes.txt")  # without an image it is no second place
    check_nclt(settings(root))
    laid(root, f"images/{DATE}/lb3/Cam5/2.tiff")
    with pytest.raises(InputError, match="both hold images of 2012-08-04"):
        check_nclt(settings(root))


def test_the_table_of_the_undistortion_is_wanted_only_where_asked_for(root):
    with pytest.raises(
        InputError, match=r"U2D_Cam5_1616X1232\.txt: no such file; it comes in .*U2D_ALL.*undistort=false"
    ):
        check_nclt(settings(root, undistort=True))
    laid(root, "U2D/U2D_Cam5_1616X1232.txt")
    check_nclt(settings(root, undistort=True))
    assert table_file(root, "Cam5") == root / "U2D" / "U2D_Cam5_1616X1232.txt"


def test_a_folder_of_annotations_that_was_named_must_be_there(root, tmp_path):
    with pytest.raises(InputError, match=r"dataset\.annotations=mine: no such folder"):
        check_nclt(settings(root, annotations="mine"))
    (root / "mine").mkdir()
    check_nclt(settings(root, annotations="mine"))
    check_nclt(settings(root, annotations=str(root / "mine")))
