"""Distribution of each facet over the pixels that the facet reaches in slant range and azimuth.

Neighbouring facets share their edges and together fill every pixel of smooth ground evenly. Therefore no power is lost
or counted twice, and the image of flat ground shows no pattern of facets.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from radcal.compiled import threaded

ANGLES_PER_RADIAN = 65535.0 / (np.pi / 2.0)
VISIBLE, LAID_OVER, OBJECT, PARTLY = 1, 2, 4, 8  # bit flags of a facet's state; partly: with a hidden part
ROOF = 4  # position of the number of a roof's material in a facet's state
# smallest cosine of the incidence angle (of 89.4 degrees) in an illuminated area; ground at larger angles is in shadow
_LEAST_COSINE = 0.01


@threaded
def count_facets(
    part: Any, near: Any, far: Any, state: Any, per_column: Any, left: Any, rows: Any, columns: Any, counts: Any,
    layover: Any, shadow: Any,
) -> None:  # fmt: skip
    """Number of visible facets that reach each pixel, and masks of the pixels in layover and in shadow.

    ``near`` and ``far`` are the nearest and furthest image row of each facet, as fractional numbers, shape (lines,
    facets). ``per_column`` is the number of azimuth lines per image column, and ``left`` is the column of the whole
    image that is the first of the arrays. ``part`` is the range of columns of the arrays to compute: the first column,
    and the column after the last.
    """
    lines, facets = near.shape
    for column in range(part[0], part[1]):
        low, high = (left + column) * per_column, (left + column + 1) * per_column
        for line in range(int(np.floor(low)), min(lines, int(np.ceil(high)))):
            if min(line + 1.0, high) - max(float(line), low) < 1e-6:
                continue
            for f in range(facets):
                a, b = int(np.floor(near[line, f])), int(np.floor(far[line, f]))
                if b < 0 or a >= rows:
                    continue
                a, b = max(a, 0), min(b, rows - 1)
                if state[line, f] & VISIBLE:
                    for row in range(a, b + 1):
                        counts[row * columns + column] += 1
                    if state[line, f] & LAID_OVER:
                        for row in range(a, b + 1):
                            layover[row, column] = True
                else:
                    for row in range(a, b + 1):
                        shadow[row, column] = True


@threaded
def fill_facets(
    part: Any, near: Any, far: Any, state: Any, angle: Any, area: Any, material: Any, k: Any, per_column: Any,
    left: Any, rows: Any, columns: Any, start: Any, by_area: Any, objects: Any, roofs: Any, out_material: Any,
    out_angle: Any,
    out_weight: Any, place: Any,
) -> None:  # fmt: skip
    """Material, incidence angle and weight of the part of each visible facet that lies in a pixel, sorted by pixel.

    The weight of a part of the ground is its area [m2]. For the radiometry ``sigma0_local``, the weight is instead the
    part's extent in slant range [image rows] times its width in azimuth [lines]. The weight of a part of an object,
    whose material id is ``objects``, is its share of the object's radar cross-section [m2], for every radiometry.
    A part of a roof has the weight of ground, and the material id that ``roofs`` holds for its number. ``place``
    receives, for each part, the azimuth line of its facet and the facet's index along the line. Of what stands on the
    ground the line is negative, -1 - line; of what has a cross-section as its weight the index is, too, -1 - index. The
    arguments ``left`` and ``part`` are those of :func:`count_facets`.
    """
    lines, facets = near.shape
    filled = np.zeros(rows, np.int32)
    for column in range(part[0], part[1]):
        filled[:] = 0
        low, high = (left + column) * per_column, (left + column + 1) * per_column
        for line in range(int(np.floor(low)), min(lines, int(np.ceil(high)))):
            beside = min(line + 1.0, high) - max(float(line), low)
            if beside < 1e-6:
                continue
            for f in range(facets):
                if not state[line, f] & VISIBLE:
                    continue
                first, last = near[line, f], far[line, f]
                a, b = int(np.floor(first)), int(np.floor(last))
                if b < 0 or a >= rows:
                    continue
                length = max(last - first, np.float32(1e-6))
                for row in range(max(a, 0), min(b, rows - 1) + 1):
                    inside = min(last, np.float32(row + 1)) - max(first, np.float32(row))
                    share = max(inside, np.float32(0.0)) / length if a != b else np.float32(1.0)
                    at = start[row * columns + column] + filled[row]
                    filled[row] += 1
                    of_object, roof = (state[line, f] & OBJECT) != 0, state[line, f] >> ROOF
                    out_material[at] = objects if of_object else material[line // k, f // k]
                    if roof:
                        out_material[at] = roofs[roof - 1]
                    out_angle[at] = angle[line, f]
                    if by_area or of_object:
                        out_weight[at] = share * beside * area[line, f]
                    else:
                        out_weight[at] = max(share * length, 1e-9) * beside
                    place[0, at] = -1 - line if of_object or roof else line
                    place[1, at] = -1 - f if of_object else f


@threaded
def order_facets(
    part: Any, start: Any, columns: Any, material: Any, angle: Any, weight: Any, place: Any, of_ground: Any,
    of_objects: Any, cells: Any, pure: Any, mean_deg: Any, ground: Any,
) -> None:  # fmt: skip
    """Sort each pixel's facets by material, scale their weights, and average their incidence and position.

    Weights that are cross-sections (negative indices in ``place``) are multiplied by ``of_objects``, all others by
    ``of_ground``; both factors have the shape (rows,). The averages do not include what stands on the ground (negative
    lines in ``place``), except the mean position of a pixel without ground. A pixel without ground has no mean
    incidence. ``part`` is the range of image rows to compute: the first row, and the row after the last.
    """
    for row in range(part[0], part[1]):
        for pixel in range(row * columns, (row + 1) * columns):
            first, last = start[pixel], start[pixel + 1]
            cells[pixel] = 0
            if first == last:
                continue
            for i in range(first + 1, last):  # insertion sort, because a pixel has few facets; this sort is stable
                m, a, w, p, q = material[i], angle[i], weight[i], place[0, i], place[1, i]
                j = i - 1
                while j >= first and material[j] > m:
                    material[j + 1], angle[j + 1], weight[j + 1] = material[j], angle[j], weight[j]
                    place[0, j + 1], place[1, j + 1] = place[0, j], place[1, j]
                    j -= 1
                material[j + 1], angle[j + 1], weight[j + 1] = m, a, w
                place[0, j + 1], place[1, j + 1] = p, q
            total, angles, down, across = 0.0, 0.0, 0.0, 0.0
            count, grounds = 1, 0
            for i in range(first, last):
                if i > first and material[i] != material[i - 1]:
                    count += 1
                if place[0, i] >= 0.0:
                    grounds += 1
                    total += weight[i]
                    angles += weight[i] * angle[i]
                    down += weight[i] * place[0, i]
                    across += weight[i] * place[1, i]
            cells[pixel] = count
            pure[pixel] = material[first] if count == 1 and grounds == last - first else 0
            if grounds == 0:
                for i in range(first, last):
                    down += (-1.0 - place[0, i]) / (last - first)
                    across += (place[1, i] if place[1, i] >= 0.0 else -1.0 - place[1, i]) / (last - first)
                total = 1.0
            elif total == 0.0:  # the areas of slivers may be 0 in single precision: mean without weights
                for i in range(first, last):
                    if place[0, i] >= 0.0:
                        angles += angle[i]
                        down += place[0, i]
                        across += place[1, i]
                total = float(grounds)
            if grounds > 0:
                mean_deg[pixel] = angles / total * (90.0 / 65535.0)
            ground[0, pixel] = down / total
            ground[1, pixel] = across / total
            for i in range(first, last):
                weight[i] = weight[i] * (of_objects[row] if place[1, i] < 0.0 else of_ground[row])


@threaded
def flatten_terrain(part: Any, start: Any, place: Any, angle: Any, weight: Any) -> None:
    """Divide each pixel's weights by the pixel's illuminated area, as the radiometry ``gamma0_rtc`` requires.

    Before the division, a weight is the ratio of a facet's area to a reference area. The reference area cancels out,
    because it is the same for all facets of a pixel. The illuminated area is the sum of area times cosine of the local
    incidence angle over the ground's facets (Small 2011, equation for the area of gamma0). The weight in a pixel with a
    single facet therefore becomes 1 / cosine of the local incidence angle. A pixel without ground keeps its weights.
    What stands on the ground has a negative line in ``place``, as in :func:`fill_facets`. ``part`` is the range of
    pixels to compute: the first pixel, and the pixel after the last.
    """
    for pixel in range(part[0], part[1]):
        total = 0.0
        for i in range(start[pixel], start[pixel + 1]):
            if place[0, i] >= 0.0:
                total += weight[i] * max(np.cos(angle[i] / ANGLES_PER_RADIAN), _LEAST_COSINE)
        if total > 0.0:
            for i in range(start[pixel], start[pixel + 1]):
                weight[i] = weight[i] / total


@threaded
def cells_of(
    part: Any, start: Any, cell_start: Any, material: Any, cell_material: Any, facet_start: Any
) -> None:  # fmt: skip
    """Material and first facet of every cell; a cell is the contribution of one material to one pixel.

    ``part`` is the range of pixels to compute: the first pixel, and the pixel after the last.
    """
    for pixel in range(part[0], part[1]):
        cell = cell_start[pixel] - 1
        for i in range(start[pixel], start[pixel + 1]):
            if i == start[pixel] or material[i] != material[i - 1]:
                cell += 1
                cell_material[cell] = material[i]
                facet_start[cell] = i
