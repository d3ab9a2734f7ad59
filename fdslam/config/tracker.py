"""The switches of the trackers."""

from __future__ import annotations

from dataclasses import dataclass

from fdslam.config.options import Checked, option


@dataclass
class Tracker(Checked):
    """Where finished runs are noted down beside their folders, to be compared. Never changes a result."""

    kind: str = option("none", "what they are noted down for", choices=("none", "tensorboard", "mlflow"))
    folder: str = option("outputs/tracking", "folder of what the tracker keeps")
