"""Which queries are easy and which are not: by their light and by how many keypoints agree with the map."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from fdslam.store import Arrays

FEW = 50  # agreeing keypoints of the best map image


def light_levels(folder: Path, names: Sequence[str]) -> list[int | None]:
    """Return how strongly the light of every query was changed, as ``photometric_level`` of annotations.json says.

    Args:
        folder: of the data set.
        names: of the queries.
    """
    path = folder / "annotations.json"
    images = json.loads(path.read_text(encoding="utf-8")).get("images", []) if path.is_file() else []
    level = {Path(one["file_name"]).name: one.get("photometric_level") for one in images}
    return [level.get(Path(name).name) for name in names]


def agreeing(seen: Sequence[Arrays]) -> list[int]:
    """Return how many keypoints of every query agree with its best map image; 0 where none does."""
    return [int(one["inliers"][0]) if len(one["inliers"]) else 0 for one in seen]


def splits(levels: Sequence[int | None], inliers: Sequence[int]) -> dict[str, list[int]]:
    """Return the queries of every part by its name, parts without queries left out.

    Args:
        levels: of every query's light; None where it is not told.
        inliers: of every query.
    """
    known = sorted({level for level in levels if level is not None})
    parts = {f"light changed, level {level}": [q for q, one in enumerate(levels) if one == level] for level in known}
    parts[f"under {FEW} agreeing keypoints"] = [q for q, count in enumerate(inliers) if count < FEW]
    parts[f"{FEW} agreeing keypoints or more"] = [q for q, count in enumerate(inliers) if count >= FEW]
    return {name: queries for name, queries in parts.items() if queries}
