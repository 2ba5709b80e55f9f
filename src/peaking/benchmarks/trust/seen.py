"""Is what is called never seen in no view, and is what is in no view called so?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from jaxtyping import Float32, UInt8

from peaking.benchmarks.trust.judge import RULES
from peaking.benchmarks.trust.scores import Marks, mean, ratio
from peaking.benchmarks.trust.stage import Stage, spread

COUNTS = 5, 15, 40
"""After so many views it is asked."""

DARK, BRIGHT = 0.25, 0.5
"""Luma of the live picture, 0…1, below and above which a surface is dark, or bright."""

SURFACES = "all", "dark", "bright"


def measure(stage: Stage) -> Iterator[dict[str, object]]:
    """Ask at held-out frames after 5, 15 and 40 views; yield the result last, {} before it.

    The device measures depth; `without_live_depth` is as if it did not. The paper's mark is what
    its blend of three views leaves empty, by its preset.
    """
    after: dict[str, object] = {}
    papers: dict[str, object] = {}
    for count in dict.fromkeys(min(count, len(stage.scene.views)) for count in COUNTS):
        numbers = stage.views(count)
        judge = stage.judge(numbers)
        marks = {rule: _Groups() for rule in RULES}
        blind = Marks()
        known_shares: list[float] = []
        unmarked = {rule: [0, 0] for rule in RULES}
        for group in dict.fromkeys(stage.scene.held_out.values()):
            for index in spread(stage.held_out(group), stage.plan.poses):
                frame = stage.frame(index)
                said = judge.compare(frame.rgb, frame.camera, depth_m=frame.depth_m)
                unseen = {
                    "ours": said["ours"].unseen,
                    "paper": judge.paper_unseen(frame.camera),
                }
                seen, known = stage.seen_truth(numbers, index)
                known_shares.append(float(known.mean()))
                brightness = luma(frame.rgb)
                parts = {
                    "all": known,
                    "dark": known & (brightness < DARK),
                    "bright": known & (brightness > BRIGHT),
                }
                for rule in RULES:
                    for surface, counted in parts.items():
                        for where in (group, "all"):
                            marks[rule].of(where, surface).add(unseen[rule], ~seen, counted)
                    missed = ~seen & known
                    unmarked[rule][0] += int((missed & ~said[rule].marked).sum())
                    unmarked[rule][1] += int(missed.sum())
                blind.add(judge.unseen(frame.camera), ~seen, known)
                yield {}
        shares = {rule: ratio(*unmarked[rule]) for rule in RULES}
        after[str(count)] = {
            "known_share": mean(known_shares),
            **marks["ours"].as_dict(),
            "unmarked_share": shares["ours"],
            "without_live_depth": blind.as_dict(),
        }
        papers[str(count)] = {**marks["paper"].as_dict(), "unmarked_share": shares["paper"]}
    yield {"after": after, "paper": {"after": papers}}


class _Groups:
    """Marks of each group of held-out frames and each kind of surface."""

    def __init__(self) -> None:
        self._marks: dict[tuple[str, str], Marks] = {}

    def of(self, group: str, surface: str) -> Marks:
        return self._marks.setdefault((group, surface), Marks())

    def as_dict(self) -> dict[str, object]:
        """Return the whole first, then the kinds of surface, then the groups."""
        groups = sorted({group for group, _ in self._marks} - {"all"})
        return {
            **self.of("all", "all").as_dict(),
            "surfaces": {kind: self.of("all", kind).as_dict() for kind in SURFACES[1:]},
            "groups": {group: self.of(group, "all").as_dict() for group in groups},
        }


def luma(rgb: UInt8[np.ndarray, "h w 3"]) -> Float32[np.ndarray, "h w"]:
    """Return the brightness of encoded colours, 0…1 (ITU-R BT.601)."""
    weights = np.array([0.299, 0.587, 0.114], np.float32) / np.float32(255)
    return rgb.astype(np.float32) @ weights
