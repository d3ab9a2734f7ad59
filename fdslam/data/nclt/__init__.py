"""NCLT as it lies on disk (docs/nclt.md)."""

from fdslam.data.nclt.layout import check_nclt
from fdslam.data.nclt.loader import load_nclt, outline_nclt

__all__ = ["check_nclt", "load_nclt", "outline_nclt"]
