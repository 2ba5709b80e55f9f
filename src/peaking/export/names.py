"""The formats of data sets that can be written."""

from __future__ import annotations

from typing import Literal, get_args

DatasetFormat = Literal["nerfstudio", "colmap", "colmap-text", "instant-ngp", "llff", "tum"]
DATASET_FORMATS: tuple[DatasetFormat, ...] = get_args(DatasetFormat)
