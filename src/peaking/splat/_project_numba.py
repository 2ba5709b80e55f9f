# pyright: basic
"""From Gaussians in the world to ellipses on the picture, and gradients back; float32 or float64.

A row of `parameters` is a Gaussian, a row of `splats` is what the rasteriser needs of it; their
columns have names in `columns.py`. `by_x` is the gradient of the loss by x.
"""

from __future__ import annotations

import math

import numba as nb

from peaking.splat.columns import (
    BLUE,
    BY_BLUE,
    BY_CONIC_UU,
    BY_CONIC_UV,
    BY_CONIC_VV,
    BY_GREEN,
    BY_OPACITY,
    BY_RED,
    BY_U,
    BY_V,
    CONIC_UU,
    CONIC_UV,
    CONIC_VV,
    DEPTH,
    GREEN,
    LOG_SCALE_X,
    LOG_SCALE_Y,
    LOG_SCALE_Z,
    MEAN_X,
    MEAN_Y,
    MEAN_Z,
    MIN_POWER,
    NUM_COLUMNS,
    OPACITY,
    OPACITY_LOGIT,
    QUAT_W,
    QUAT_X,
    QUAT_Y,
    QUAT_Z,
    RADIUS_U,
    RADIUS_V,
    RED,
    SH0_B,
    SH0_G,
    SH0_R,
    SH1_X_R,
    SH1_Y_R,
    SH1_Z_R,
    U,
    V,
)
from peaking.splat.rendering import C0, C1, DILATION_PX2, FIELD_MARGIN

_DEGREE_0 = NUM_COLUMNS[0]


@nb.njit(cache=True, error_model="numpy", inline="always")
def _camera_point(p, i, m):
    x = m[0, 0] * p[i, MEAN_X] + m[0, 1] * p[i, MEAN_Y] + m[0, 2] * p[i, MEAN_Z] + m[0, 3]
    y = m[1, 0] * p[i, MEAN_X] + m[1, 1] * p[i, MEAN_Y] + m[1, 2] * p[i, MEAN_Z] + m[1, 3]
    z = m[2, 0] * p[i, MEAN_X] + m[2, 1] * p[i, MEAN_Y] + m[2, 2] * p[i, MEAN_Z] + m[2, 3]
    return x, y, z


@nb.njit(cache=True, error_model="numpy", inline="always")
def _field(focal, center, size):
    margin = 0.5 * FIELD_MARGIN * size
    return (-margin - center) / focal, (size + margin - center) / focal


@nb.njit(cache=True, error_model="numpy")
def _rotation(w, a, b, c):
    return (
        1 - 2 * (b * b + c * c),
        2 * (a * b - w * c),
        2 * (a * c + w * b),
        2 * (a * b + w * c),
        1 - 2 * (a * a + c * c),
        2 * (b * c - w * a),
        2 * (a * c - w * b),
        2 * (b * c + w * a),
        1 - 2 * (a * a + b * b),
    )


@nb.njit(cache=True, error_model="numpy")
def _unit_quaternion(p, i):
    n = math.sqrt(p[i, QUAT_W] ** 2 + p[i, QUAT_X] ** 2 + p[i, QUAT_Y] ** 2 + p[i, QUAT_Z] ** 2)
    n = max(n, 1e-12)
    return p[i, QUAT_W] / n, p[i, QUAT_X] / n, p[i, QUAT_Y] / n, p[i, QUAT_Z] / n, n


@nb.njit(cache=True, error_model="numpy")
def _covariance(p, i):
    w, a, b, c, _ = _unit_quaternion(p, i)
    r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(w, a, b, c)
    s0 = math.exp(2 * p[i, LOG_SCALE_X])
    s1 = math.exp(2 * p[i, LOG_SCALE_Y])
    s2 = math.exp(2 * p[i, LOG_SCALE_Z])
    return (
        r00 * r00 * s0 + r01 * r01 * s1 + r02 * r02 * s2,
        r00 * r10 * s0 + r01 * r11 * s1 + r02 * r12 * s2,
        r00 * r20 * s0 + r01 * r21 * s1 + r02 * r22 * s2,
        r10 * r10 * s0 + r11 * r11 * s1 + r12 * r12 * s2,
        r10 * r20 * s0 + r11 * r21 * s1 + r12 * r22 * s2,
        r20 * r20 * s0 + r21 * r21 * s1 + r22 * r22 * s2,
    )


@nb.njit(cache=True, parallel=True, error_model="numpy")
def project(parameters, cam_from_world, intrinsics, near_m, alpha_min, splats):
    """Fill `splats`; `cam_from_world` is 3×4, `intrinsics` are fx, fy, cx, cy, width and height."""
    p, m = parameters, cam_from_world
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    width, height = intrinsics[4], intrinsics[5]
    left, right = _field(fx, cx, width)
    top, bottom = _field(fy, cy, height)
    eye0 = -(m[0, 0] * m[0, 3] + m[1, 0] * m[1, 3] + m[2, 0] * m[2, 3])
    eye1 = -(m[0, 1] * m[0, 3] + m[1, 1] * m[1, 3] + m[2, 1] * m[2, 3])
    eye2 = -(m[0, 2] * m[0, 3] + m[1, 2] * m[1, 3] + m[2, 2] * m[2, 3])
    for i in nb.prange(p.shape[0]):
        splats[i, RADIUS_U] = 0
        splats[i, RADIUS_V] = 0
        x, y, z = _camera_point(p, i, m)
        if not z >= near_m:
            continue
        u = fx * x / z + cx
        v = fy * y / z + cy
        tx = min(right, max(left, x / z)) * z
        ty = min(bottom, max(top, y / z)) * z
        c00, c01, c02, c11, c12, c22 = _covariance(p, i)
        j0 = fx / z
        j2 = -fx * tx / (z * z)
        j4 = fy / z
        j5 = -fy * ty / (z * z)
        t00 = j0 * m[0, 0] + j2 * m[2, 0]
        t01 = j0 * m[0, 1] + j2 * m[2, 1]
        t02 = j0 * m[0, 2] + j2 * m[2, 2]
        t10 = j4 * m[1, 0] + j5 * m[2, 0]
        t11 = j4 * m[1, 1] + j5 * m[2, 1]
        t12 = j4 * m[1, 2] + j5 * m[2, 2]
        v0 = t00 * c00 + t01 * c01 + t02 * c02
        v1 = t00 * c01 + t01 * c11 + t02 * c12
        v2 = t00 * c02 + t01 * c12 + t02 * c22
        xx = v0 * t00 + v1 * t01 + v2 * t02 + DILATION_PX2
        xy = v0 * t10 + v1 * t11 + v2 * t12
        v0 = t10 * c00 + t11 * c01 + t12 * c02
        v1 = t10 * c01 + t11 * c11 + t12 * c12
        v2 = t10 * c02 + t11 * c12 + t12 * c22
        yy = v0 * t10 + v1 * t11 + v2 * t12 + DILATION_PX2
        det = xx * yy - xy * xy
        opacity = 1 / (1 + math.exp(-p[i, OPACITY_LOGIT]))
        if not (det > 0 and det < 1e12 and opacity > alpha_min):
            continue
        reach = 2 * math.log(opacity / alpha_min)
        rx = math.sqrt(reach * xx)
        ry = math.sqrt(reach * yy)
        if not (u + rx > 0 and u - rx < width and v + ry > 0 and v - ry < height):
            continue
        splats[i, U] = u
        splats[i, V] = v
        splats[i, CONIC_UU] = yy / det
        splats[i, CONIC_UV] = -xy / det
        splats[i, CONIC_VV] = xx / det
        splats[i, OPACITY] = opacity
        dx = p[i, MEAN_X] - eye0
        dy = p[i, MEAN_Y] - eye1
        dz = p[i, MEAN_Z] - eye2
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        for c in range(3):
            value = C0 * p[i, SH0_R + c] + 0.5
            if p.shape[1] > _DEGREE_0:
                value += (C1 / length) * (
                    -dy * p[i, SH1_Y_R + c] + dz * p[i, SH1_Z_R + c] - dx * p[i, SH1_X_R + c]
                )
            splats[i, RED + c] = max(value, 0.0)
        splats[i, DEPTH] = z
        splats[i, RADIUS_U] = rx
        splats[i, RADIUS_V] = ry
        splats[i, MIN_POWER] = -0.5 * reach


@nb.njit(cache=True, parallel=True, error_model="numpy")
def project_backward(
    parameters,
    cam_from_world,
    intrinsics,
    splats,
    starts,
    by_entry,
    gradients,
    grad2d,
    count,
):
    """Fill `gradients` from those of the tiles' entries.

    `by_entry[starts[i] : starts[i + 1]]` belongs to Gaussian i. To `grad2d` is added the length of
    the gradient by the projected centre, in half pictures, and to `count` 1, as in gsplat.
    """
    p, m = parameters, cam_from_world
    fx, fy, cx, cy = intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]
    width, height = intrinsics[4], intrinsics[5]
    left, right = _field(fx, cx, width)
    top, bottom = _field(fy, cy, height)
    eye0 = -(m[0, 0] * m[0, 3] + m[1, 0] * m[1, 3] + m[2, 0] * m[2, 3])
    eye1 = -(m[0, 1] * m[0, 3] + m[1, 1] * m[1, 3] + m[2, 1] * m[2, 3])
    eye2 = -(m[0, 2] * m[0, 3] + m[1, 2] * m[1, 3] + m[2, 2] * m[2, 3])
    for i in nb.prange(p.shape[0]):
        for c in range(p.shape[1]):
            gradients[i, c] = 0
        if splats[i, RADIUS_U] <= 0:
            continue
        red = splats.dtype.type(0)
        green = red
        blue = red
        by_opacity = red
        gu = red
        gv = red
        g0 = red
        g1 = red
        g2 = red
        for e in range(starts[i], starts[i + 1]):
            red += by_entry[e, BY_RED]
            green += by_entry[e, BY_GREEN]
            blue += by_entry[e, BY_BLUE]
            by_opacity += by_entry[e, BY_OPACITY]
            gu += by_entry[e, BY_U]
            gv += by_entry[e, BY_V]
            g0 += by_entry[e, BY_CONIC_UU]
            g1 += by_entry[e, BY_CONIC_UV]
            g2 += by_entry[e, BY_CONIC_VV]
        grad2d[i] += math.sqrt((gu * width * 0.5) ** 2 + (gv * height * 0.5) ** 2)
        count[i] += 1
        x, y, z = _camera_point(p, i, m)
        tx = min(right, max(left, x / z)) * z
        ty = min(bottom, max(top, y / z)) * z
        # The covariance on the picture: dS = -Q G Q, with the off-diagonal of G halved.
        q0 = splats[i, CONIC_UU]
        q1 = splats[i, CONIC_UV]
        q2 = splats[i, CONIC_VV]
        g1 = 0.5 * g1
        a00 = q0 * g0 + q1 * g1
        a01 = q0 * g1 + q1 * g2
        a10 = q1 * g0 + q2 * g1
        a11 = q1 * g1 + q2 * g2
        m00 = -(a00 * q0 + a01 * q1)
        m01 = -(a00 * q1 + a01 * q2)
        m11 = -(a10 * q1 + a11 * q2)
        j0 = fx / z
        j2 = -fx * tx / (z * z)
        j4 = fy / z
        j5 = -fy * ty / (z * z)
        t00 = j0 * m[0, 0] + j2 * m[2, 0]
        t01 = j0 * m[0, 1] + j2 * m[2, 1]
        t02 = j0 * m[0, 2] + j2 * m[2, 2]
        t10 = j4 * m[1, 0] + j5 * m[2, 0]
        t11 = j4 * m[1, 1] + j5 * m[2, 1]
        t12 = j4 * m[1, 2] + j5 * m[2, 2]
        # T = J R: the covariance in the world gets Tᵀ M T, and T gets 2 M T S.
        p00 = m00 * t00 + m01 * t10
        p01 = m00 * t01 + m01 * t11
        p02 = m00 * t02 + m01 * t12
        p10 = m01 * t00 + m11 * t10
        p11 = m01 * t01 + m11 * t11
        p12 = m01 * t02 + m11 * t12
        d00 = t00 * p00 + t10 * p10
        d01 = t00 * p01 + t10 * p11
        d02 = t00 * p02 + t10 * p12
        d11 = t01 * p01 + t11 * p11
        d12 = t01 * p02 + t11 * p12
        d22 = t02 * p02 + t12 * p12
        c00, c01, c02, c11, c12, c22 = _covariance(p, i)
        k00 = 2 * (p00 * c00 + p01 * c01 + p02 * c02)
        k01 = 2 * (p00 * c01 + p01 * c11 + p02 * c12)
        k02 = 2 * (p00 * c02 + p01 * c12 + p02 * c22)
        k10 = 2 * (p10 * c00 + p11 * c01 + p12 * c02)
        k11 = 2 * (p10 * c01 + p11 * c11 + p12 * c12)
        k12 = 2 * (p10 * c02 + p11 * c12 + p12 * c22)
        by_j0 = k00 * m[0, 0] + k01 * m[0, 1] + k02 * m[0, 2]
        by_j2 = k00 * m[2, 0] + k01 * m[2, 1] + k02 * m[2, 2]
        by_j4 = k10 * m[1, 0] + k11 * m[1, 1] + k12 * m[1, 2]
        by_j5 = k10 * m[2, 0] + k11 * m[2, 1] + k12 * m[2, 2]
        iz2 = 1 / (z * z)
        by_x = gu * fx / z
        by_y = gv * fy / z
        by_z = -gu * fx * x * iz2 - gv * fy * y * iz2 - fx * iz2 * by_j0 - fy * iz2 * by_j4
        if left < x / z < right:
            by_x -= fx * iz2 * by_j2
            by_z += 2 * fx * tx * iz2 / z * by_j2
        else:
            by_z += fx * tx * iz2 / z * by_j2
        if top < y / z < bottom:
            by_y -= fy * iz2 * by_j5
            by_z += 2 * fy * ty * iz2 / z * by_j5
        else:
            by_z += fy * ty * iz2 / z * by_j5
        for c in range(3):
            gradients[i, MEAN_X + c] = m[0, c] * by_x + m[1, c] * by_y + m[2, c] * by_z

        w, a, b, c_, norm = _unit_quaternion(p, i)
        r00, r01, r02, r10, r11, r12, r20, r21, r22 = _rotation(w, a, b, c_)
        s0 = math.exp(2 * p[i, LOG_SCALE_X])
        s1 = math.exp(2 * p[i, LOG_SCALE_Y])
        s2 = math.exp(2 * p[i, LOG_SCALE_Z])
        e00 = d00 * r00 + d01 * r10 + d02 * r20
        e01 = d00 * r01 + d01 * r11 + d02 * r21
        e02 = d00 * r02 + d01 * r12 + d02 * r22
        e10 = d01 * r00 + d11 * r10 + d12 * r20
        e11 = d01 * r01 + d11 * r11 + d12 * r21
        e12 = d01 * r02 + d11 * r12 + d12 * r22
        e20 = d02 * r00 + d12 * r10 + d22 * r20
        e21 = d02 * r01 + d12 * r11 + d22 * r21
        e22 = d02 * r02 + d12 * r12 + d22 * r22
        gradients[i, LOG_SCALE_X] = 2 * s0 * (r00 * e00 + r10 * e10 + r20 * e20)
        gradients[i, LOG_SCALE_Y] = 2 * s1 * (r01 * e01 + r11 * e11 + r21 * e21)
        gradients[i, LOG_SCALE_Z] = 2 * s2 * (r02 * e02 + r12 * e12 + r22 * e22)
        f00 = 2 * e00 * s0
        f01 = 2 * e01 * s1
        f02 = 2 * e02 * s2
        f10 = 2 * e10 * s0
        f11 = 2 * e11 * s1
        f12 = 2 * e12 * s2
        f20 = 2 * e20 * s0
        f21 = 2 * e21 * s1
        f22 = 2 * e22 * s2
        by_w = 2 * (-c_ * f01 + b * f02 + c_ * f10 - a * f12 - b * f20 + a * f21)
        by_a = 2 * (
            b * f01 + c_ * f02 + b * f10 - 2 * a * f11 - w * f12 + c_ * f20 + w * f21 - 2 * a * f22
        )
        by_b = 2 * (
            -2 * b * f00 + a * f01 + w * f02 + a * f10 + c_ * f12 - w * f20 + c_ * f21 - 2 * b * f22
        )
        by_c = 2 * (
            -2 * c_ * f00 - w * f01 + a * f02 + w * f10 - 2 * c_ * f11 + b * f12 + a * f20 + b * f21
        )
        along = by_w * w + by_a * a + by_b * b + by_c * c_
        gradients[i, QUAT_W] = (by_w - along * w) / norm
        gradients[i, QUAT_X] = (by_a - along * a) / norm
        gradients[i, QUAT_Y] = (by_b - along * b) / norm
        gradients[i, QUAT_Z] = (by_c - along * c_) / norm
        opacity = splats[i, OPACITY]
        gradients[i, OPACITY_LOGIT] = by_opacity * opacity * (1 - opacity)

        red = red if splats[i, RED] > 0 else 0 * red
        green = green if splats[i, GREEN] > 0 else 0 * green
        blue = blue if splats[i, BLUE] > 0 else 0 * blue
        gradients[i, SH0_R] = C0 * red
        gradients[i, SH0_G] = C0 * green
        gradients[i, SH0_B] = C0 * blue
        if p.shape[1] > _DEGREE_0:
            dx = p[i, MEAN_X] - eye0
            dy = p[i, MEAN_Y] - eye1
            dz = p[i, MEAN_Z] - eye2
            inverse = 1 / math.sqrt(dx * dx + dy * dy + dz * dz)
            dx *= inverse
            dy *= inverse
            dz *= inverse
            for k in range(3):
                basis = C1 * (-dy if k == 0 else (dz if k == 1 else -dx))
                gradients[i, SH1_Y_R + 3 * k] = basis * red
                gradients[i, SH1_Y_R + 3 * k + 1] = basis * green
                gradients[i, SH1_Y_R + 3 * k + 2] = basis * blue
            hy = -C1 * (p[i, SH1_Y_R] * red + p[i, SH1_Y_R + 1] * green + p[i, SH1_Y_R + 2] * blue)
            hz = C1 * (p[i, SH1_Z_R] * red + p[i, SH1_Z_R + 1] * green + p[i, SH1_Z_R + 2] * blue)
            hx = -C1 * (p[i, SH1_X_R] * red + p[i, SH1_X_R + 1] * green + p[i, SH1_X_R + 2] * blue)
            radial = hx * dx + hy * dy + hz * dz
            gradients[i, MEAN_X] += (hx - radial * dx) * inverse
            gradients[i, MEAN_Y] += (hy - radial * dy) * inverse
            gradients[i, MEAN_Z] += (hz - radial * dz) * inverse
