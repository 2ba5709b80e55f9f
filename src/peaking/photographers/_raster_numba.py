# pyright: basic
"""Triangles to pictures on one core: z-buffer, then each sample is shaded once.

A triangle is a cone from the camera (Olano and Greer 1997): with corners a, b, c in the camera's
frame and a pixel's ray d (z = 1), the edge functions are d·(b×c), d·(c×a), d·(a×b); their sum over
the determinant a·(b×c) is 1/depth, and their shares are the weights of the corners, right in
perspective. So nothing need be clipped but the rectangle in which a triangle is looked for.
"""

from __future__ import annotations

import numba as nb
import numpy as np

NEAR_M = 0.02
SHARPER = 1.4
"""Size of a pixel for textures, in samples: 2 at most."""
CLUSTER = 64
"""So many neighbouring faces are looked at or left out together."""


@nb.njit(cache=True)
def to_camera(points_m, rotation, origin_m, out):
    """Points of the world in the camera's frame."""
    for i in range(points_m.shape[0]):
        x = points_m[i, 0] - origin_m[0]
        y = points_m[i, 1] - origin_m[1]
        z = points_m[i, 2] - origin_m[2]
        for k in range(3):
            out[i, k] = rotation[0, k] * x + rotation[1, k] * y + rotation[2, k] * z


@nb.njit(cache=True)
def clusters_ahead(clusters, rotation, origin_m, fx, fy, cx, cy, width, height, ahead):
    """Which clusters of faces may be in the picture, by a ball around each (centre, radius)."""
    left, right = cx / fx, (width - cx) / fx
    up, down = cy / fy, (height - cy) / fy
    for i in range(clusters.shape[0]):
        x = clusters[i, 0] - origin_m[0]
        y = clusters[i, 1] - origin_m[1]
        z = clusters[i, 2] - origin_m[2]
        px = rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z
        py = rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z
        pz = rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z
        radius = clusters[i, 3]
        ahead[i] = (
            pz > -radius
            and px + left * pz > -radius * np.sqrt(1 + left * left)
            and right * pz - px > -radius * np.sqrt(1 + right * right)
            and py + up * pz > -radius * np.sqrt(1 + up * up)
            and down * pz - py > -radius * np.sqrt(1 + down * down)
        )


@nb.njit(cache=True)
def depth_pass(points_m, faces, ahead, fx, fy, cx, cy, nearness, face_at):
    """Which face each sample sees; `nearness` is 1/depth, 0 where it sees none.

    Samples are at (k + 0.5) in the pixels of this picture.
    """
    height, width = nearness.shape
    nearness[:] = 0.0
    face_at[:] = -1
    for f in range(faces.shape[0]):
        if not ahead[f // CLUSTER]:
            continue
        ia, ib, ic = faces[f, 0], faces[f, 1], faces[f, 2]
        ax, ay, az = points_m[ia, 0], points_m[ia, 1], points_m[ia, 2]
        bx, by, bz = points_m[ib, 0], points_m[ib, 1], points_m[ib, 2]
        qx, qy, qz = points_m[ic, 0], points_m[ic, 1], points_m[ic, 2]
        if az < NEAR_M and bz < NEAR_M and qz < NEAR_M:
            continue
        u_min, u_max, v_min, v_max = 1e30, -1e30, 1e30, -1e30
        if az >= NEAR_M and bz >= NEAR_M and qz >= NEAR_M:
            ua, va = fx * ax / az + cx, fy * ay / az + cy
            ub, vb = fx * bx / bz + cx, fy * by / bz + cy
            uc, vc = fx * qx / qz + cx, fy * qy / qz + cy
            u_min, u_max = min(ua, ub, uc), max(ua, ub, uc)
            v_min, v_max = min(va, vb, vc), max(va, vb, vc)
        else:
            for k in range(3):
                i, j = faces[f, k], faces[f, (k + 1) % 3]
                px, py, pz = points_m[i, 0], points_m[i, 1], points_m[i, 2]
                if pz < NEAR_M and points_m[j, 2] < NEAR_M:
                    continue
                for end in range(2):  # the part of this edge that is before the camera
                    gx, gy, gz = px, py, pz
                    if end == 1:
                        gx, gy, gz = points_m[j, 0], points_m[j, 1], points_m[j, 2]
                    if gz < NEAR_M:
                        share = (NEAR_M - pz) / (points_m[j, 2] - pz)
                        gx = px + share * (points_m[j, 0] - px)
                        gy = py + share * (points_m[j, 1] - py)
                        gz = NEAR_M
                    u, v = fx * gx / gz + cx, fy * gy / gz + cy
                    u_min, u_max = min(u_min, u), max(u_max, u)
                    v_min, v_max = min(v_min, v), max(v_max, v)
        if u_max < 0.0 or v_max < 0.0 or u_min > width or v_min > height:
            continue
        left = max(0, int(np.ceil(max(u_min, 0.0) - 0.5)))
        right = int(np.floor(min(u_max, float(width)) - 0.5)) + 1
        top = max(0, int(np.ceil(max(v_min, 0.0) - 0.5)))
        bottom = int(np.floor(min(v_max, float(height)) - 0.5)) + 1
        if left >= right or top >= bottom:
            continue
        e0x, e0y, e0z = by * qz - bz * qy, bz * qx - bx * qz, bx * qy - by * qx
        e1x, e1y, e1z = qy * az - qz * ay, qz * ax - qx * az, qx * ay - qy * ax
        e2x, e2y, e2z = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        det = ax * e0x + ay * e0y + az * e0z
        if abs(det) < 1e-18:
            continue
        inverse = 1.0 / det
        # By the sign of the determinant all three are >= 0 inside.
        d0, d1, d2 = e0x * inverse / fx, e1x * inverse / fx, e2x * inverse / fx
        start_x = (left + 0.5 - cx) / fx
        for row in range(top, bottom):
            y = (row + 0.5 - cy) / fy
            w0 = (e0x * start_x + e0y * y + e0z) * inverse
            w1 = (e1x * start_x + e1y * y + e1z) * inverse
            w2 = (e2x * start_x + e2y * y + e2z) * inverse
            for col in range(left, right):
                if w0 >= 0.0 and w1 >= 0.0 and w2 >= 0.0:
                    near = w0 + w1 + w2
                    if near > nearness[row, col] and near * NEAR_M <= 1.0:
                        nearness[row, col] = near
                        face_at[row, col] = f
                w0 += d0
                w1 += d1
                w2 += d2


@nb.njit(cache=True, fastmath=True)
def shade(
    points_m, faces, uvs, light, texture_of, density_px_per_m, textures, texels, to_linear,
    fx, fy, cx, cy, nearness, face_at, picture,
):  # fmt: skip
    """Colour each pixel: every face that its 2×2 samples see once, in the middle of those samples.

    Texture is looked up bilinearly in two mip levels, and multiplied by the baked light. `textures`
    (t levels 3) has start, width and height of every level. `picture` is linear, h w 3.
    """
    picture[:] = 0.0
    colour = np.zeros(3)
    for sample in range(nearness.size):
        row, col = (sample // 4) // picture.shape[1], (sample // 4) % picture.shape[1]
        own = sample % 4
        f = face_at[2 * row + own // 2, 2 * col + own % 2]
        if f < 0:
            continue
        count, x, y, near, is_first = 0, 0.0, 0.0, 0.0, True
        for other in range(4):
            below, right = 2 * row + other // 2, 2 * col + other % 2
            if face_at[below, right] == f:
                is_first = is_first and other >= own
                count += 1
                x += (right + 0.5 - cx) / fx
                y += (below + 0.5 - cy) / fy
                near += nearness[below, right]
        if is_first:
            x, y, near = x / count, y / count, near / count
            ia, ib, ic = faces[f, 0], faces[f, 1], faces[f, 2]
            ax, ay, az = points_m[ia, 0], points_m[ia, 1], points_m[ia, 2]
            bx, by, bz = points_m[ib, 0], points_m[ib, 1], points_m[ib, 2]
            qx, qy, qz = points_m[ic, 0], points_m[ic, 1], points_m[ic, 2]
            w0 = x * (by * qz - bz * qy) + y * (bz * qx - bx * qz) + (bx * qy - by * qx)
            w1 = x * (qy * az - qz * ay) + y * (qz * ax - qx * az) + (qx * ay - qy * ax)
            w2 = x * (ay * bz - az * by) + y * (az * bx - ax * bz) + (ax * by - ay * bx)
            total = w0 + w1 + w2
            w0, w1, w2 = w0 / total, w1 / total, w2 / total
            u = w0 * uvs[ia, 0] + w1 * uvs[ib, 0] + w2 * uvs[ic, 0]
            v = w0 * uvs[ia, 1] + w1 * uvs[ib, 1] + w2 * uvs[ic, 1]
            # How slanted: the cosine between the ray and the normal.
            nx = (by - ay) * (qz - az) - (bz - az) * (qy - ay)
            ny = (bz - az) * (qx - ax) - (bx - ax) * (qz - az)
            nz = (bx - ax) * (qy - ay) - (by - ay) * (qx - ax)
            slant = abs(nx * x + ny * y + nz) / (
                np.sqrt((nx * nx + ny * ny + nz * nz) * (x * x + y * y + 1.0)) + 1e-30
            )
            step_m = SHARPER / (near * fx)
            covered = density_px_per_m[f] * step_m / np.sqrt(max(slant, 0.05))
            level = max(0.0, np.log2(max(covered, 1e-6)))
            texture = texture_of[f]
            whole = int(level)
            for k in range(3):
                colour[k] = 0.0
            for upper in range(2):
                share = level - whole if upper == 1 else 1.0 - (level - whole)
                if share < 1.0 / 64.0:
                    continue
                mip = min(whole + upper, textures.shape[1] - 1)
                start, wide, high = (
                    textures[texture, mip, 0],
                    textures[texture, mip, 1],
                    textures[texture, mip, 2],
                )
                s, t = u * wide - 0.5, v * high - 0.5
                s0, t0 = int(np.floor(s)), int(np.floor(t))
                fs, ft = s - s0, t - t0
                for dt in range(2):
                    line = start + ((t0 + dt) % high) * wide
                    weight_t = share * (ft if dt == 1 else 1.0 - ft)
                    for ds in range(2):
                        weight = weight_t * (fs if ds == 1 else 1.0 - fs)
                        place = line + (s0 + ds) % wide
                        for k in range(3):
                            colour[k] += weight * to_linear[texels[place, k]]
            for k in range(3):
                lit = w0 * light[ia, k] + w1 * light[ib, k] + w2 * light[ic, k]
                picture[row, col, k] += np.float32(0.25 * count * colour[k] * lit)


@nb.njit(cache=True, fastmath=True)
def encode(picture, table, steps_per_unit, out):
    """Linear light to 8-bit sRGB by a table over the square root."""
    last = table.shape[0] - 1
    for row in range(picture.shape[0]):
        for col in range(picture.shape[1]):
            for k in range(3):
                place = int(np.sqrt(max(picture[row, col, k], 0.0)) * steps_per_unit + 0.5)
                out[row, col, k] = table[min(place, last)]


@nb.njit(cache=True, fastmath=True)
def add_lamp(points_m, normals, lamp_m, lamp_normal, rgb, emits_everywhere, nearness, sides, light):
    """Add what one small lamp gives to every point, seen through its shadow maps.

    `nearness` (6 s s): 1/depth as the lamp sees it, in six directions; `sides` (6 3 3): the
    camera's axes of each as rows. A point is lit from either side of its surface.
    """
    size = nearness.shape[1]
    for i in range(points_m.shape[0]):
        dx = points_m[i, 0] - lamp_m[0]
        dy = points_m[i, 1] - lamp_m[1]
        dz = points_m[i, 2] - lamp_m[2]
        squared = dx * dx + dy * dy + dz * dz
        distance = np.sqrt(squared)
        along = (dx * lamp_normal[0] + dy * lamp_normal[1] + dz * lamp_normal[2]) / distance
        if not emits_everywhere and along <= 0.0:
            continue
        facing = -(dx * normals[i, 0] + dy * normals[i, 1] + dz * normals[i, 2]) / distance
        # A centimetre off the surface, towards the lamp, so that it does not shade itself.
        off = 0.012 if facing > 0 else -0.012
        dx += off * normals[i, 0]
        dy += off * normals[i, 1]
        dz += off * normals[i, 2]
        side = 0
        if abs(dx) >= abs(dy) and abs(dx) >= abs(dz):
            side = 0 if dx > 0 else 1
        elif abs(dy) >= abs(dz):
            side = 2 if dy > 0 else 3
        else:
            side = 4 if dz > 0 else 5
        x = sides[side, 0, 0] * dx + sides[side, 0, 1] * dy + sides[side, 0, 2] * dz
        y = sides[side, 1, 0] * dx + sides[side, 1, 1] * dy + sides[side, 1, 2] * dz
        z = sides[side, 2, 0] * dx + sides[side, 2, 1] * dy + sides[side, 2, 2] * dz
        u, v = (x / z + 1.0) * size / 2 - 0.5, (y / z + 1.0) * size / 2 - 0.5
        u0, v0 = int(np.floor(u)), int(np.floor(v))
        seen = 0.0
        for dv in range(2):
            for du in range(2):
                weight = (u - u0 if du else 1.0 - u + u0) * (v - v0 if dv else 1.0 - v + v0)
                near = nearness[
                    side, min(max(v0 + dv, 0), size - 1), min(max(u0 + du, 0), size - 1)
                ]
                if near * z <= 1.02 + 0.01 * near:
                    seen += weight
        cosine = abs(facing) * (1.0 if emits_everywhere else along)
        gain = seen * cosine / max(squared, 0.04)
        for k in range(3):
            light[i, k] += np.float32(gain * rgb[k])
