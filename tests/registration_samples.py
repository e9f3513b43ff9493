"""Images of fields under speckle, and smooth displacements of them."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter, map_coordinates

from radcal.config import Radar
from radcal.findings import Finding
from radcal.image.model import Measurement
from radcal.registration.displacement import invert
from radcal.registration.registered import Registered

RADAR = Radar(
    altitude_m=4000.0, range_resolution_m=7.0, azimuth_resolution_m=9.0, range_spacing_m=4.0, azimuth_spacing_m=5.0
)  # depression 45 degrees, incidence 45 degrees
PLAIN = Finding("polarisation_unknown", "note", "a.tif")


def ground(shape, seed):
    """Mean backscatter of fields with straight borders [dB]."""
    rng = np.random.default_rng(seed)
    image = np.zeros(shape)
    for _ in range(60):
        row, column = rng.integers(0, shape[0]), rng.integers(0, shape[1])
        image[row : row + rng.integers(15, 70), column : column + rng.integers(15, 70)] = rng.normal(0.0, 6.0)
    return image


def speckled(mean_db, seed, looks=4):
    """Independent multilook speckle on a mean image [dB]."""
    gain = np.random.default_rng(seed).gamma(looks, 1.0 / looks, mean_db.shape)
    return (mean_db + 10.0 * np.log10(gain)).astype(np.float32)


def smooth_field(shape, seed, length, sigma):
    """Displacement of a largest length [pixel], both of whose components are smoothed noise."""
    noise = np.random.default_rng(seed).standard_normal((2, *shape))
    field = np.stack([gaussian_filter(part, sigma, mode="reflect") for part in noise])
    return field * length / np.hypot(*field).max()


def displaced(mean_db, field):
    """Mean image that is displaced by a field."""
    return map_coordinates(mean_db, np.indices(mean_db.shape) + invert(field), order=1, mode="nearest")


def hills(shape, slope_deg):
    """Heights of hills of some hundred metres on cells of 5 m, whose slopes have an sd."""
    rough = gaussian_filter(np.random.default_rng(5).standard_normal(shape), 12, mode="wrap")
    return rough * np.tan(np.radians(slope_deg)) * 5.0 / np.gradient(rough)[1].std()


def registered_by(field, **changed):
    """An empty image, of which something was found, moved by a displacement."""
    nothing, moved = np.zeros(field.shape[1:], np.float32), field.astype(np.float32)
    image = Measurement(nothing, "a.tif", findings=(PLAIN,))
    return replace(Registered(image, nothing, moved, nothing, 0.0, "gefolki", True, ""), **changed)
