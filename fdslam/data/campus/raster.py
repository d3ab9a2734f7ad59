"""Painting of quads by their homographies, with an exact z-buffer.

For a quad origin + s·right + t·down and the matrix M = K [right down origin] in camera coordinates, M⁻¹ (x, y, 1)ᵀ =
(s, t, 1)ᵀ / z: one matrix gives the texture coordinates and the inverse depth, which is linear in the pixel. Every
pixel has SS × SS samples; a quad owns a sample whose centre it covers, unless its texture has a hole there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.camera import NEAR, Camera
from fdslam.data.campus.scene import Mesh
from fdslam.data.campus.texture import Texture

SS = 2  # samples per pixel and axis
HOLE = 128  # alpha below this is a hole


@dataclass
class Buffers:
    """What has been painted so far; all arrays have SS × SS samples per pixel."""

    color: NDArray[np.uint8]  # [H·SS, W·SS, 3] RGB
    inverse: NDArray[np.float32]  # [H·SS, W·SS] 1 / depth, 0 in the sky
    quad: NDArray[np.int32]  # [H·SS, W·SS] index into label and item
    label: list[int] = field(default_factory=list)  # per painted quad: index into LABELS
    item: list[int] = field(default_factory=list)  # per painted quad: number of the change object, or -1

    def copy(self) -> Buffers:
        """Return buffers that can be painted over without touching these."""
        return Buffers(self.color.copy(), self.inverse.copy(), self.quad.copy(), self.label[:], self.item[:])

    def count(self, items: int) -> list[int]:
        """Return the number of samples that each of the change objects 0..items - 1 owns."""
        per_quad = np.bincount(self.quad.ravel(), minlength=len(self.item))
        per_item = np.bincount(np.array(self.item) + 1, weights=per_quad, minlength=items + 1)
        return [int(n) for n in per_item[1 : items + 1]]

    def wipe(self) -> None:
        """Forget all that has been painted; the colours stay, but nothing owns them."""
        self.inverse[:], self.quad[:] = 0, 0
        del self.label[1:], self.item[1:]

    def boxes(self, items: Sequence[int] | NDArray[np.int64]) -> NDArray[np.float32]:
        """Return the tight half-open boxes [n, 4] xyxy of the pixels in which each change object owns a sample.

        Args:
            items: [n] numbers of change objects.

        Raises:
            ValueError: an object owns none.
        """
        boxes = np.empty((len(items), 4), np.float32)
        item = np.array(self.item)
        for row, k in enumerate(items):
            mask = (item == k)[self.quad]
            if not mask.any():
                raise ValueError(f"object {k} cannot be seen")
            rows, columns = np.flatnonzero(mask.any(1)) // SS, np.flatnonzero(mask.any(0)) // SS
            boxes[row] = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
        return boxes


@dataclass(frozen=True)
class Resolved:
    """One value per pixel."""

    color: NDArray[np.uint8]  # [H, W, 3] mean of the samples
    label: NDArray[np.uint8]  # [H, W] index into LABELS of the quad that owns the nearest sample
    depth: NDArray[np.float32]  # [H, W] metres, from the mean inverse depth of that quad's samples; inf in the sky


def resolve(buffers: Buffers) -> Resolved:
    """Reduce the samples to pixels."""
    starts = [np.s_[j::SS, i::SS] for j in range(SS) for i in range(SS)]
    parts = [(buffers.inverse[s], buffers.quad[s]) for s in starts]
    best, owner = (a.copy() for a in parts[0])
    for inverse, quad in parts[1:]:
        nearer = inverse > best
        np.copyto(best, inverse, where=nearer)
        np.copyto(owner, quad, where=nearer)
    total, n = np.zeros(owner.shape, np.float32), np.zeros(owner.shape, np.float32)
    for inverse, quad in parts:
        same = quad == owner
        total += inverse * same
        n += same
    with np.errstate(divide="ignore"):
        depth = n / total
    color = cv2.resize(buffers.color, owner.shape[::-1], interpolation=cv2.INTER_AREA)
    return Resolved(np.asarray(color, np.uint8), np.array(buffers.label, np.uint8)[owner], depth)


def _clip(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cut a polygon [n, 3] in camera coordinates at the plane z = NEAR."""
    kept = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        if a[2] >= NEAR:
            kept.append(a)
        if (a[2] >= NEAR) != (b[2] >= NEAR):
            kept.append(a + (b - a) * ((NEAR - a[2]) / (b[2] - a[2])))
    return np.array(kept).reshape(-1, 3)


def cover(polygon: NDArray[np.float64], x0: int, x1: int, y0: int, y1: int) -> NDArray[np.bool_]:
    """Return which sample centres of a window lie in a convex polygon.

    Args:
        polygon: [n, 2] corners in samples, in either sense of rotation.
        x0: first column; x1: one after the last; y0, y1: the same for rows.

    Returns:
        [y1 - y0, x1 - x0].
    """
    ys = np.arange(y0, y1) + 0.5
    left, right = np.full(len(ys), -np.inf), np.full(len(ys), np.inf)
    corners = polygon.tolist()
    edges = list(zip(corners, corners[1:] + corners[:1], strict=True))
    sense = 1 if sum(ax * by - bx * ay for (ax, ay), (bx, by) in edges) > 0 else -1
    for (ax, ay), (bx, by) in edges:
        # A sample is inside where nx·x + ny·y + c >= 0 for every edge.
        nx, ny = -(by - ay) * sense, (bx - ax) * sense
        c = -(nx * ax + ny * ay)
        if abs(nx) < 1e-9:
            right[ny * ys + c < 0] = -np.inf
        elif nx > 0:
            np.maximum(left, (ny * ys + c) / -nx, out=left)
        else:
            np.minimum(right, (ny * ys + c) / -nx, out=right)
    xs = np.arange(x0, x1) + 0.5
    inside: NDArray[np.bool_] = xs >= left[:, None]
    inside &= xs <= right[:, None]
    return inside


def _patch(
    texture: Texture, inverse: NDArray[np.float64], x0: int, y0: int, x1: int, y1: int, at: tuple[float, float]
) -> NDArray[np.uint8]:
    """Return the texture as seen in a window, reduced to fit the scale at the sample ``at``."""
    base = texture.level(0, 0)
    s, t, w = inverse @ (*at, 1.0)
    s, t = s / w, t / w
    # How fast (s, t) change from sample to sample there.
    ds = np.abs((inverse[0, :2] - s * inverse[2, :2]) / w).max() * base.shape[1]
    dt = np.abs((inverse[1, :2] - t * inverse[2, :2]) / w).max() * base.shape[0]
    lx, ly = (int(min(12, max(0.0, np.log2(max(d, 1e-9)) + 0.4))) for d in (ds, dt))
    image = texture.level(lx, ly)
    h, w = image.shape[:2]
    to_texture = np.array([[w, 0, -0.5], [0, h, -0.5], [0, 0, 1.0]]) @ inverse
    window = to_texture @ np.array([[1, 0, x0 + 0.5], [0, 1, y0 + 0.5], [0, 0, 1.0]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    patch = cv2.warpPerspective(image, window, (x1 - x0, y1 - y0), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(patch, np.uint8)


def _in_view(
    corners: NDArray[np.float64], matrix: NDArray[np.float64], width: int, height: int, far: float
) -> NDArray[np.bool_]:
    """Tell which quads, of ``corners`` [Q, 4, 3] in the camera's frame, may reach into the view's pyramid: bool [Q]."""
    x, y, z = (corners[..., k] for k in range(3))
    ahead = ~(z < NEAR).all(1) & (z.min(1) < far)
    low, high = (np.linalg.inv(matrix) @ p for p in ([0, 0, 1.0], [width, height, 1.0]))
    for v, a, b in ((x, low[0], high[0]), (y, low[1], high[1])):
        ahead &= ~(v < a * z).all(1) & ~(v > b * z).all(1)
    return ahead


def _shows_a_side(mesh: Mesh, camera: Camera) -> NDArray[np.bool_]:
    """Tell which quads turn a painted side to the camera: bool [Q]."""
    facing = ((camera.position - mesh.origin) * mesh.normal).sum(1)
    return (facing > 1e-3) | (mesh.two_sided & (facing < -1e-3))


def paint(buffers: Buffers, camera: Camera, mesh: Mesh, gain: NDArray[np.float64], far: float = 150.0) -> None:
    """Paint quads over what is there, keeping whatever is nearer.

    Args:
        buffers: painted in place.
        camera: at 1 / SS of the buffers' size.
        mesh: what to paint.
        gain: [Q, 3] light on each quad, a factor of its texture's RGB.
        far: quads beyond this many metres are left out.
    """
    height, width = buffers.inverse.shape
    matrix = camera.matrix(SS)
    origin = camera.to_camera(mesh.origin)
    right, down = mesh.right @ camera.axes.T, mesh.down @ camera.axes.T
    start, stop = (origin + mesh.span[:, k, None] * right for k in (0, 1))
    corners = np.stack([start, stop, stop + down, start + down], axis=1)  # [Q, 4, 3]
    seen = np.flatnonzero(_in_view(corners, matrix, width, height, far) & _shows_a_side(mesh, camera))
    if not len(seen):
        return
    inverses = np.linalg.inv(matrix @ np.stack([right[seen], down[seen], origin[seen]], axis=2))
    # From front to back, so that hidden quads are found out before their textures are warped.
    for k in np.argsort(np.linalg.norm(corners[seen].mean(1), axis=1), kind="stable"):
        q, inverse = seen[k], inverses[k]
        polygon = corners[q] if corners[q, :, 2].min() >= NEAR else _clip(corners[q])
        pixels = polygon @ matrix.T
        pixels = pixels[:, :2] / pixels[:, 2:]
        x0, y0 = (int(max(0, np.ceil(v - 0.5))) for v in pixels.min(0))
        x1, y1 = (int(min(n, np.floor(v - 0.5) + 1)) for v, n in zip(pixels.max(0), (width, height), strict=True))
        if x0 >= x1 or y0 >= y1:
            continue
        # The quad's nearest point against the farthest thing there: most hidden quads end here.
        if 1 / polygon[:, 2].min() <= buffers.inverse[y0:y1, x0:x1].min():
            continue
        a, b, c = inverse[2]
        near = ((b * (np.arange(y0, y1) + 0.5) + c)[:, None] + a * (np.arange(x0, x1) + 0.5)).astype(np.float32)
        mask = cover(pixels, x0, x1, y0, y1)
        mask &= near > buffers.inverse[y0:y1, x0:x1]
        rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
        if not len(rows):
            continue
        # One resolution for the whole quad, whatever hides parts of it, or holes would move when a thing is taken away.
        middle = (x0 + x1) / 2, (y0 + y1) / 2
        r0, r1, c0, c1 = rows[0], rows[-1] + 1, columns[0], columns[-1] + 1
        mask, near = mask[r0:r1, c0:c1], near[r0:r1, c0:c1]
        x0, x1, y0, y1 = x0 + c0, x0 + c1, y0 + r0, y0 + r1
        patch = _patch(mesh.textures[q], inverse, x0, y0, x1, y1, middle)
        if patch.shape[2] == 4:
            mask &= patch[..., 3] >= HOLE
            patch = np.ascontiguousarray(patch[..., :3])
        window = np.s_[y0:y1, x0:x1]
        table = np.clip(np.rint(np.arange(256)[:, None] * gain[q]), 0, 255).astype(np.uint8)
        lit = cv2.LUT(patch, table.reshape(1, 256, 3))
        cv2.copyTo(lit, mask.astype(np.uint8), buffers.color[window])
        np.copyto(buffers.inverse[window], near, where=mask)
        np.copyto(buffers.quad[window], len(buffers.label), where=mask)
        buffers.label.append(int(mesh.label[q]))
        buffers.item.append(int(mesh.item[q]))
