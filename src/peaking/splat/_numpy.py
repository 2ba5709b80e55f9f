"""The definition: every Gaussian over every pixel, in float64, near to far."""

from __future__ import annotations

import numpy as np
from jaxtyping import Float64

from peaking.geometry import Camera
from peaking.splat.columns import LOG_SCALES, MEANS, OPACITY_LOGIT, QUATS, SH
from peaking.splat.rendering import C0, C1, DILATION_PX2, FIELD_MARGIN, CutOffs, Rendering


def render(
    parameters: Float64[np.ndarray, "n columns"], camera: Camera, cut_offs: CutOffs
) -> Rendering:
    """Render; see `peaking.splat.rasterise.render`."""
    k = camera.pinhole
    cam_from_world = camera.world_from_cam.inverse()
    means = cam_from_world.apply(parameters[:, MEANS])
    pixels = k.pixel_centers()
    rgb, depth_sum = np.zeros((*pixels.shape[:2], 3)), np.zeros(pixels.shape[:2])
    transmittance = np.ones(pixels.shape[:2])
    done = np.zeros(pixels.shape[:2], dtype=bool)
    for i in np.argsort(means[:, 2], kind="stable"):
        x, y, z = means[i]
        if z < cut_offs.near_m:
            continue
        covariance = _covariance_px2(parameters[i], means[i], cam_from_world.rotation, camera)
        center = np.array([k.fx_px * x / z + k.cx_px, k.fy_px * y / z + k.cy_px])
        away = pixels - center
        power = -0.5 * np.einsum("hwi,ij,hwj->hw", away, np.linalg.inv(covariance), away)
        opacity = 1 / (1 + np.exp(-parameters[i, OPACITY_LOGIT]))
        alpha = np.minimum(cut_offs.alpha_max, opacity * np.exp(power))
        alpha[alpha < cut_offs.alpha_min] = 0.0
        done |= transmittance * (1 - alpha) < cut_offs.min_transmittance
        alpha[done] = 0.0
        weight = alpha * transmittance
        rgb += weight[..., None] * _colour(parameters[i], camera.position_m)
        depth_sum += weight * z
        transmittance = transmittance - weight
    alpha = 1 - transmittance
    depth_m = np.divide(depth_sum, alpha, out=np.zeros_like(alpha), where=alpha > 1e-6)
    return Rendering(rgb, alpha, depth_m)


def _covariance_px2(
    row: Float64[np.ndarray, "columns"],
    in_cam_m: Float64[np.ndarray, "3"],
    rotation: Float64[np.ndarray, "3 3"],
    camera: Camera,
) -> Float64[np.ndarray, "2 2"]:
    """Return the covariance on the picture: J R S Rᵀ Jᵀ, dilated (Zwicker et al. 2001)."""
    w, a, b, c = row[QUATS] / np.linalg.norm(row[QUATS])
    world_from_own = np.array(
        [
            [1 - 2 * (b * b + c * c), 2 * (a * b - w * c), 2 * (a * c + w * b)],
            [2 * (a * b + w * c), 1 - 2 * (a * a + c * c), 2 * (b * c - w * a)],
            [2 * (a * c - w * b), 2 * (b * c + w * a), 1 - 2 * (a * a + b * b)],
        ]
    )
    k = camera.pinhole
    x, y, z = in_cam_m
    margin = 0.5 * FIELD_MARGIN * np.array(k.size_px)
    focal, center = np.array([k.fx_px, k.fy_px]), np.array([k.cx_px, k.cy_px])
    lowest, highest = (-margin - center) / focal, (np.array(k.size_px) + margin - center) / focal
    tx, ty = np.clip([x / z, y / z], lowest, highest) * z
    jacobian = np.array(
        [[k.fx_px / z, 0, -k.fx_px * tx / z**2], [0, k.fy_px / z, -k.fy_px * ty / z**2]]
    )
    half = jacobian @ rotation @ world_from_own @ np.diag(np.exp(row[LOG_SCALES]))
    return half @ half.T + DILATION_PX2 * np.eye(2)


def _colour(
    row: Float64[np.ndarray, "columns"], eye_m: Float64[np.ndarray, "3"]
) -> Float64[np.ndarray, "3"]:
    sh = row[SH].reshape(-1, 3)
    colour = 0.5 + C0 * sh[0]
    if len(sh) > 1:
        x, y, z = (row[MEANS] - eye_m) / np.linalg.norm(row[MEANS] - eye_m)
        colour = colour + C1 * (-y * sh[1] + z * sh[2] - x * sh[3])
    return np.maximum(colour, 0.0)
