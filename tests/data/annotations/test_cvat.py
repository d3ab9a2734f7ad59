import math

import pytest

from fdslam.data.annotations.cvat import SHAPES, read_cvat
from fdslam.errors import InputError
from tests.data.annotations.samples import BOX, CVAT, cvat


def test_reads_names_sizes_boxes_labels_and_lines(tmp_path):
    path = cvat(tmp_path / "a.xml")
    empty, one, other = read_cvat(path)
    assert [image.file for image in (empty, one, other)] == ["00.png", "01.png", "query/02.png"]
    assert {image.size for image in (empty, one, other)} == {(160, 120)}
    assert empty.annotations == ()
    assert [(a.xyxy, a.label, a.where) for a in one.annotations] == [
        ((40.5, 60, 80, 100), "car", f"{path}, line 16: the box 'car'")
    ]
    assert other.annotations[0].xyxy == (150, -5, 180, 15)
    assert one.where == f"{path}, line 15"


@pytest.mark.parametrize(
    ("text", "xyxy"),
    [
        ('<polygon label="car" points="10.5,20;30,5;12,40.25"/>', (10.5, 5, 30, 40.25)),
        ('<ellipse label="car" cx="50" cy="40" rx="20" ry="10"/>', (30, 30, 70, 50)),
        ('<ellipse label="car" cx="50" cy="40" rx="20" ry="10" rotation="90"/>', (40, 20, 60, 60)),
        ('<box label="car" xtl="10" ytl="20" xbr="50" ybr="40" rotation="90.0"/>', (20, 10, 40, 50)),
        ('<box label="car" xtl="10" ytl="20" xbr="50" ybr="40" rotation="180"/>', (10, 20, 50, 40)),
        ('<mask label="car" rle="3, 2, 1" left="7" top="8" width="3" height="2"/>', (7, 8, 10, 10)),
        (
            '<cuboid label="car" xtl1="5" ytl1="6" xbl1="5" ybl1="20" xtr1="9" ytr1="6" xbr1="9" ybr1="20" '
            'xtl2="15" ytl2="4" xbl2="15" ybl2="18" xtr2="11" ytr2="4" xbr2="11" ybr2="18"/>',
            (5, 4, 15, 20),
        ),
    ],
)
def test_every_shape_becomes_the_box_around_it(tmp_path, text, xyxy):
    [annotation] = read_cvat(cvat(tmp_path / "a.xml", text))[1].annotations
    assert annotation.xyxy == pytest.approx(xyxy)


def test_a_turned_box_is_enclosed(tmp_path):
    text = '<box label="car" xtl="10" ytl="20" xbr="50" ybr="40" rotation="30"/>'
    [annotation] = read_cvat(cvat(tmp_path / "a.xml", text))[1].annotations
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
    turned = [(30 + c * x - s * y, 30 + s * x + c * y) for x in (-20, 20) for y in (-10, 10)]  # corner by corner
    xs, ys = zip(*turned, strict=True)
    assert annotation.xyxy == pytest.approx((min(xs), min(ys), max(xs), max(ys)))


def test_tags_are_left_out_and_said(tmp_path, caplog):
    images = read_cvat(cvat(tmp_path / "a.xml", '<tag label="night" source="manual"></tag>', BOX))
    assert len(images[1].annotations) == 1
    assert "1 tags are of whole images and left out" in caplog.text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('<points label="car" points="1,2"/>', r"line 16: the points 'car' has no area; draw a rectangle"),
        ('<skeleton label="man"><points label="head" points="1,2"/></skeleton>', "line 16: the skeleton 'man' has no"),
        ('<blob label="car"/>', "line 16: the blob 'car' has no area"),
        ('<box label="car" xtl="1" ytl="2" xbr="3"/>', r"line 16: the box 'car' lacks 'ybr'"),
        ('<box label="car" xtl="nan" ytl="2" xbr="3" ybr="4"/>', "line 16: .*nan is no number of pixels"),
        ('<box label="car" xtl="left" ytl="2" xbr="3" ybr="4"/>', "line 16: .*'left'"),
        ('<box label="car" xtl="3" ytl="2" xbr="1" ybr="4"/>', "line 16: .*it is empty"),
        ('<box label="car" xtl="1" ytl="2" xbr="3" ybr="4" rotation="inf"/>', "line 16: .*inf is no number"),
        ('<polygon label="car" points=""/>', "line 16: the polygon 'car' cannot be read"),
        ('<polygon label="car" points="1,2;3"/>', r"line 16: .*\[3\.0\] is no point"),
        ('<box label="car" xtl="1" ytl="2" xbr="3" ybr="4">', "line 17: no XML .*mismatched tag"),
    ],
)
def test_a_shape_that_cannot_be_read_is_named_with_its_line(tmp_path, text, said):
    with pytest.raises(InputError, match=rf"a\.xml, {said}"):
        read_cvat(cvat(tmp_path / "a.xml", text))


@pytest.mark.parametrize("share", [0.0, 0.3, 0.9])
def test_a_truncated_file_is_named_with_the_line_of_its_end(tmp_path, share):
    path = cvat(tmp_path / "a.xml")
    text = path.read_text()[: int(share * len(path.read_text()))]
    path.write_text(text)
    with pytest.raises(InputError, match=rf"a\.xml, line {text.count(chr(10)) + 1}: no XML"):
        read_cvat(path)


def test_video_and_foreign_files_are_named_precisely(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text('<annotations>\n<meta/>\n<track id="0" label="car"><box frame="3"/></track>\n</annotations>')
    with pytest.raises(InputError, match=r"line 3: a track, as in 'CVAT for video 1\.1'.*'CVAT for images 1\.1'"):
        read_cvat(path)
    path.write_text("<annotation><filename>a.jpg</filename></annotation>")  # Pascal VOC
    with pytest.raises(InputError, match="line 1: begins with <annotation>"):
        read_cvat(path)
    path.write_text("<annotations><version>1.1</version></annotations>")
    with pytest.raises(InputError, match="holds no image"):
        read_cvat(path)
    path.write_text('<annotations>\n<image id="0" width="3" height="4"/></annotations>')
    with pytest.raises(InputError, match="line 2: an image without name"):
        read_cvat(path)
    path.write_text(CVAT.replace('width="160"', 'width="wide"', 1).replace("{shapes}", ""))
    with pytest.raises(InputError, match="line 13: the width is 'wide'"):
        read_cvat(path)
    path.write_bytes(b'<?xml version="1.0" encoding="klingon"?><annotations/>')
    with pytest.raises(InputError, match=r"a\.xml"):
        read_cvat(path)


def test_entities_are_never_expanded_nor_fetched(tmp_path):
    (tmp_path / "secret").write_text("7")
    bomb = "".join(f'<!ENTITY a{i} "{f"&a{i - 1};" * 10}">\n' for i in range(1, 12))
    for declared in (f'<!ENTITY a0 "ha">\n{bomb}', f'<!ENTITY a11 SYSTEM "file://{tmp_path}/secret">'):
        text = CVAT.replace("{shapes}", BOX.replace("car", "&a11;"))
        path = tmp_path / "a.xml"
        path.write_text(text.replace("<annotations>", f"<!DOCTYPE annotations [\n{declared}]>\n<annotations>", 1))
        with pytest.raises(InputError, match=r"a\.xml, line 2: has a document type"):
            read_cvat(path)


def test_the_shapes_of_the_documentation_are_read():
    assert set(SHAPES) == {"box", "polygon", "ellipse", "cuboid", "mask"}
