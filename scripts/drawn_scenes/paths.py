"""How cameras look at things, and photographs that are held out beside, above and behind others."""

import cv2
import numpy as np

from peaking.photographers.drawn.phone import tremor

BETWEEN, BESIDE, ABOVE, BEHIND = "between", "beside", "above", "behind"
BEHIND_M = 0.6


def looking(at_m: np.ndarray, aim_m: np.ndarray, angles_rad: np.ndarray) -> np.ndarray:
    """The 4x4 camera-to-world pose of a level camera that looks at `aim_m`, then turned a little.

    OpenGL camera axes, metres; +Z of the world is up.
    """
    forward = aim_m - at_m
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    level = np.stack([right, np.cross(right, forward), -forward], axis=1)
    pose = np.eye(4)
    pose[:3, :3] = level @ cv2.Rodrigues(angles_rad)[0]
    pose[:3, 3] = at_m
    return pose


def by_hand(at_m: np.ndarray, aim_m: np.ndarray, shot: int, seed: int) -> np.ndarray:
    """`looking`, by a hand that places a photograph to about 1 cm and 1 degree."""
    shake = tremor(7.0 * shot, seed)
    return looking(at_m + 0.01 * shake[:3], aim_m, np.radians(1.0 * shake[3:]))


def held_out_place(
    group: str, at_m: np.ndarray, aim_m: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """A place 0.2 to 0.5 m beside, 0.2 to 0.4 m above, or 0.6 m behind a camera at `at_m`."""
    ahead = aim_m - at_m
    ahead /= np.linalg.norm(ahead)
    if group == BEHIND:
        level = ahead * (1.0, 1.0, 0.0)
        return at_m - BEHIND_M * level / np.linalg.norm(level)
    if group == ABOVE:
        return at_m + np.array((0.0, 0.0, rng.uniform(0.2, 0.4)))
    right = np.cross(ahead, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    return at_m + right * rng.uniform(0.2, 0.5) * rng.choice((-1.0, 1.0))
