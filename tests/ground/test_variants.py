"""Wrong variants of levels, bins, noise masks and effects of fields, against numpy's matrices."""

import numpy as np
from variants import agrees

from radcal.ground.bins import class_cumulants, class_of, incidence_edges
from radcal.ground.levels import image_levels, median_and_range, pooled_offset
from radcal.ground.patches import Spread, gls_mean, patch_effects, pooled
from radcal.ground.pixels import noise_limited

FIELD = np.array([0, 0, 1, 1, 1, 2])
MEAN = np.array([-11.0, -10.2, -13.1, -12.0, -12.6, -9.4])
SAMPLING = np.array([0.04, 0.3, 0.09, 0.25, 0.06, 0.5])
SPREAD = Spread(1.3, 0.45)


def test_levels_are_median_and_quartiles():
    values = np.array([-19.0, -13.5, -12.0, -11.0, -10.5, -10.2, -6.0])
    agrees(
        median_and_range(values),
        [-11.0, 2.4],
        mean=[values.mean(), 2.4],
        sd=[-11.0, values.std()],
        half_range=[-11.0, 1.2],
        tails=[-11.0, np.ptp(values)],
    )
    measured = np.linspace(-25.0, -5.0, 60).reshape(6, 10) ** 2 / -40.0
    reference = np.linspace(-21.0, -9.0, 60).reshape(6, 10)
    found = image_levels(measured.astype(np.float32), reference.astype(np.float32), np.ones((6, 10), np.uint8), {})
    shift = np.median(measured) - np.median(reference)
    scale = np.subtract(*np.percentile(measured, [75, 25])) / np.subtract(*np.percentile(reference, [75, 25]))
    agrees(
        [found.offset_db, found.scale],
        [shift, scale],
        rtol=1e-5,
        sign=[-shift, scale],
        inverse=[shift, 1.0 / scale],
        sd=[shift, measured.std() / reference.std()],
        mean=[measured.mean() - reference.mean(), scale],
    )


def test_offset_of_two_materials_has_the_variance_between_them():
    """Two differences: the moments' estimate of the variance between them is that of the pair less the mean square."""
    a, b, s, t = 2.6, -0.7, 0.4, 0.9
    tau2 = 0.5 * (a - b) ** 2 - 0.5 * (s**2 + t**2)
    w = np.array([s**-2, t**-2])
    v = np.array([s**2, t**2]) + tau2
    right = [np.average([a, b], weights=1.0 / v), (1.0 / v).sum() ** -0.5]
    agrees(
        pooled_offset([a, b], [s, t]),
        right,
        fixed=[np.average([a, b], weights=w), w.sum() ** -0.5],
        mean=[0.5 * (a + b), right[1]],
        by_errors=[np.average([a, b], weights=1.0 / np.sqrt(v)), right[1]],
        variance=[right[0], right[1] ** 2],
        between_alone=[0.5 * (a + b), np.sqrt(0.5 * tau2)],
    )


def test_bins_hold_equal_numbers_and_their_moments():
    rng = np.random.default_rng(3)
    angle, values = 30.0 + 20.0 * rng.random(900) ** 2, rng.gamma(2.0, 1.5, 900) - 14.0
    edges = incidence_edges(angle, 4)
    agrees(
        edges,
        np.quantile(angle, np.linspace(0.0, 1.0, 5)),
        rtol=1e-3,
        equal_width=np.linspace(angle.min(), angle.max(), 5),
        in_tangent=np.degrees(np.arctan(np.linspace(*np.tan(np.radians([angle.min(), angle.max()])), 5))),
    )
    member = class_of(angle, edges)
    parts = [
        values[(angle >= low) & (angle < high)] for low, high in zip(edges[:-1], [*edges[1:-1], 99.0], strict=True)
    ]
    right = [[p.mean(), p.var(), ((p - p.mean()) ** 3).mean()] for p in parts]
    agrees(
        class_cumulants(values, member, 4),
        right,
        rtol=1e-9,
        backwards=right[::-1],
        power=[[10.0 * np.log10((10.0 ** (p / 10.0)).mean()), r[1], r[2]] for p, r in zip(parts, right, strict=True)],
        sample=[[r[0], r[1] * p.size / (p.size - 1), r[2]] for p, r in zip(parts, right, strict=True)],
        sd=[[r[0], np.sqrt(r[1]), r[2]] for r in right],
        skewness=[[r[0], r[1], r[2] / r[1] ** 1.5] for r in right],
        sign=[[r[0], r[1], -r[2]] for r in right],
        of_all=[[r[0], values.var(), r[2]] for r in right],
    )


def test_pixels_near_the_noise_by_the_sum_of_powers():
    """Levels about the threshold: noise plus a signal of the required ratio."""
    noise, ratio_db = -21.0, 2.0
    right = 10.0 * np.log10(10.0 ** (noise / 10.0) * (1.0 + 10.0 ** (ratio_db / 10.0)))
    levels = np.linspace(noise - 3.0, noise + 8.0, 1101)
    found = [noise_limited(np.full((1, 1), x, np.float32), np.array([noise]), ratio_db)[0, 0] for x in levels]
    agrees(
        levels[np.count_nonzero(found)],
        right,
        atol=0.02,
        rtol=0.0,
        ratio_of_total=noise + ratio_db,
        noise_itself=noise,
        amplitude=20.0 * np.log10(10.0 ** (noise / 20.0) * (1.0 + 10.0 ** (ratio_db / 20.0))),
    )


def test_means_of_cells_by_the_inverse_of_their_covariance():
    shared = (FIELD[:, None] == FIELD).astype(float)
    covariance = np.diag(SAMPLING + SPREAD.within**2) + SPREAD.between**2 * shared
    one, inverse = np.ones(6), np.linalg.inv(covariance)
    right = [one @ inverse @ MEAN / inverse.sum(), 1.0 / inverse.sum()]
    plain = 1.0 / (SAMPLING + SPREAD.within**2 + SPREAD.between**2)
    speckle = 1.0 / SAMPLING
    agrees(
        gls_mean(MEAN, SAMPLING, FIELD, SPREAD),
        right,
        rtol=1e-9,
        independent=[plain @ MEAN / plain.sum(), 1.0 / plain.sum()],
        speckle=[speckle @ MEAN / speckle.sum(), 1.0 / speckle.sum()],
        equal=[MEAN.mean(), right[1]],
        error=[right[0], np.sqrt(right[1])],
        of_fields=[np.mean([MEAN[k == FIELD].mean() for k in range(3)]), right[1]],
    )
    residual = MEAN + 11.0
    effects = SPREAD.between**2 * np.equal(np.arange(3)[:, None], FIELD) @ inverse @ residual
    means = np.array([residual[k == FIELD].mean() for k in range(3)])
    _, effect_db, variance = patch_effects(residual, SAMPLING, FIELD, SPREAD)
    agrees(
        effect_db,
        effects,
        rtol=1e-9,
        unshrunk=means,
        sign=-effects,
        half=means * SPREAD.between**2 / (SPREAD.between**2 + SPREAD.within**2),
    )
    left = SPREAD.between**2 - SPREAD.between**4 * np.diag(
        np.equal(np.arange(3)[:, None], FIELD) @ inverse @ np.equal(FIELD[:, None], np.arange(3))
    )
    agrees(variance, left, rtol=1e-9, prior=np.full(3, SPREAD.between**2), error=np.sqrt(left))
    both = pooled([SPREAD, Spread(0.2, 1.1)])
    agrees(
        [both.between, both.within],
        np.sqrt([(1.69 + 0.04) / 2, (0.2025 + 1.21) / 2]),
        mean=[0.75, 0.775],
        total=np.sqrt([1.73, 1.4125]),
        variance=[0.865, 0.70625],
    )
