"""Checkpoints with drawn weights, in the official layout."""

from __future__ import annotations

from pathlib import Path

import torch

from peaking.generators.adampi.network import random_network


def write_checkpoint(path: Path, *, num_planes: int = 4, seed: int = 1) -> Path:
    """Write one, and return its path."""
    torch.save({"num_planes": num_planes, "weight": random_network(seed).state_dict()}, path)
    return path
