"""`peaking convert` as people run it."""

from __future__ import annotations
