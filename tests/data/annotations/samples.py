"""Annotations in the three formats, as the programs write them, for images of 160×120 pixels."""

import json

CVAT = """<?xml version="1.0" encoding="utf-8"?>
<annotations>
  <version>1.1</version>
  <meta>
    <task>
      <id>7</id>
      <name>campus</name>
      <mode>annotation</mode>
      <labels><label><name>car</name><type>any</type><attributes></attributes></label></labels>
    </task>
    <dumped>2026-05-04 10:11:12.345678+00:00</dumped>
  </meta>
  <image id="0" name="00.png" width="160" height="120">
  </image>
  <image id="1" name="01.png" width="160" height="120">
{shapes}
  </image>
  <image id="2" name="query/02.png" width="160" height="120">
    <box label="person" source="manual" occluded="1" xtl="150.00" ytl="-5.00" xbr="180.00" ybr="15.00" z_order="0">
      <attribute name="age">old</attribute>
    </box>
  </image>
</annotations>
"""
BOX = '    <box label="car" source="manual" occluded="0" xtl="40.5" ytl="60" xbr="80" ybr="100" z_order="0"></box>'


def cvat(path, *shapes):
    """Write a CVAT file; ``shapes`` stand on image 01.png, from line 16 on."""
    path.write_text(CVAT.replace("{shapes}", "\n".join(shapes or [BOX])), encoding="utf-8")
    return path


def shape(points, kind="rectangle", label="car"):
    return {"label": label, "points": points, "group_id": None, "description": "", "shape_type": kind, "flags": {}}


def labelme(path, image, *shapes, **changes):
    """Write one LabelMe file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    content = {"version": "5.5.0", "flags": {}, "shapes": list(shapes), "imagePath": image, "imageData": "aGVsbG8=",
               "imageHeight": 120, "imageWidth": 160} | changes  # fmt: skip
    path.write_text(json.dumps(content, indent=2), encoding="utf-8")
    return path


def coco(path, **changes):
    """Write a COCO file of two images, the first with two boxes."""
    content = {
        "images": [
            {"id": 4, "file_name": "query/01.png", "width": 160, "height": 120},
            {"id": 9, "file_name": "query/02.png"},
        ],
        "annotations": [
            {"id": 1, "image_id": 4, "category_id": 3, "bbox": [40.1, 60.3, 40.2, 40.7], "area": 1636.14},
            {"id": 2, "image_id": 4, "category_id": 2, "bbox": [1, 2, 3, 4]},
        ],
        "categories": [{"id": 2, "name": "person"}, {"id": 3, "name": "car"}],
    }
    path.write_text(json.dumps(content | changes), encoding="utf-8")
    return path
