"""Evaluation: accuracies, curves, intervals and leaders. Pure functions of LoC cells and annotated boxes."""

from fdslam.metrics.bootstrap import Figure, proportion
from fdslam.metrics.cells import box_overlap, cell_areas, positive_cells
from fdslam.metrics.evaluate import Row, evaluate
from fdslam.metrics.leaders import Leader, leaders
from fdslam.metrics.scene import Scene

__all__ = [
    "Figure",
    "Leader",
    "Row",
    "Scene",
    "box_overlap",
    "cell_areas",
    "evaluate",
    "leaders",
    "positive_cells",
    "proportion",
]
