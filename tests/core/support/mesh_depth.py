"""What a camera sees of a mesh, by a plain depth buffer: shares nothing with how proxies are made."""

import numpy as np

SAMPLES = 4_000_000  # pixels of triangles' boxes that are looked at together


def mesh_depth(vertices, faces, camera):
    """Camera-space z (H, W) at pixel centres, for a pinhole; 0 where no triangle is seen. Triangles that reach behind the
    camera are left out.
    """
    k, local = camera.intrinsics, camera.pose.transform(vertices)
    faces = faces[(local[faces, 2] > 1e-3).all(axis=1)]
    corners = k.pinhole().project(local)[faces]
    inverse = 1 / local[faces, 2]
    low = np.maximum(np.ceil(corners.min(axis=1) - 0.5), 0).astype(int)
    high = np.minimum(np.floor(corners.max(axis=1) - 0.5), (k.width - 1, k.height - 1)).astype(int)
    size = np.maximum(high - low + 1, 0)
    out = np.zeros(k.height * k.width)
    area = size.prod(axis=1)
    order = np.argsort(area)[np.count_nonzero(area == 0) :]
    done = np.cumsum(area[order])
    while len(order):
        count = max(1, int(np.searchsorted(done, SAMPLES)))
        _draw(out, k.width, corners[order[:count]], inverse[order[:count]], (low[order[:count]], size[order[:count]]))
        order = order[count:]
        done = np.cumsum(area[order])
    out = out.reshape(k.height, k.width)
    return np.where(out > 0, 1 / np.maximum(out, 1e-12), 0)


def _draw(out, width, corners, inverse, box):
    low, size = box
    count = size.prod(axis=1)
    which = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    x, y = low[which, 0] + number % size[which, 0], low[which, 1] + number // size[which, 0]
    a, b, c = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    whole = b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0]
    whole = np.where(np.abs(whole) < 1e-12, np.nan, whole)[which]
    px, py = x + 0.5 - a[which, 0], y + 0.5 - a[which, 1]
    u = (px * c[which, 1] - py * c[which, 0]) / whole
    v = (py * b[which, 0] - px * b[which, 1]) / whole
    inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
    depth = (1 - u - v) * inverse[which, 0] + u * inverse[which, 1] + v * inverse[which, 2]
    np.maximum.at(out, (y * width + x)[inside], depth[inside])
