"""Texture of materials, multiplied onto the pixels of a simulated image."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from radcal.config import Material, Radar
from radcal.radar.geometry import Geometry
from radcal.seeds import derived_seed
from radcal.speckle.texture import equal_texture, texture_db, texture_order


def orders_of(materials: Mapping[str, Material], first: Radar, radar: Radar) -> dict[str, float]:
    """Order (shape parameter) of the gamma texture of each material with the key ``looks``.

    Parameters
    ----------
    materials : mapping
        Section ``materials``.
    first : Radar
        First pass; the key ``looks`` is the effective number of looks in the image of this pass.
    radar : Radar
        Pass of the simulated image; its speckle may have another number of looks.

    Returns
    -------
    dict
        Order of the texture by material, from :func:`radcal.speckle.texture.texture_order`; infinite if the effective
        looks need no texture.
    """
    return {
        name: texture_order(radar.looks, equal_texture(first.looks, material.looks, radar.looks))
        for name, material in materials.items()
        if material.looks is not None
    }


def textured(
    pixels_db: NDArray[np.float32], order: float, seed: int, name: str, fresh: bool = False
) -> NDArray[np.float32]:
    """Pixels of a material with gamma texture of unit mean.

    Parameters
    ----------
    pixels_db : ndarray of float32, shape (n,)
        All visible pixels of the material [dB].
    order : float
        Order of the gamma texture; infinite for no texture.
    seed : int
        Seed of the case, from which the random numbers are derived. The random numbers are the same in every run, so
        that the texture is a smooth function of its order.
    name : str
        Name of the material.
    fresh : bool
        Whether the random numbers are for the final check run, which has other random numbers than all other runs.

    Returns
    -------
    ndarray of float32, shape (n,)
        Pixels with texture [dB]; the array ``pixels_db`` itself if there is no texture.
    """
    if not np.isfinite(order):
        return pixels_db
    rng = np.random.default_rng([derived_seed(seed, "texture", name), int(fresh)])
    return (pixels_db + texture_db(rng.random(pixels_db.shape), order)).astype(np.float32)


def with_textures(
    image_db: NDArray[np.float32], geometry: Geometry, orders: Mapping[str, float], seed: int, fresh: bool
) -> NDArray[np.float32]:
    """Simulated image with texture on all pixels that contain a textured material alone.

    Parameters
    ----------
    image_db : ndarray of float32, shape ``geometry.shape``
        Simulated image [dB].
    geometry : Geometry
        Geometry of the pass, which determines the pixels of each material.
    orders : mapping
        Order of the texture by material (:func:`orders_of`).
    seed, fresh : int, bool
        As in :func:`textured`.

    Returns
    -------
    ndarray of float32, shape ``geometry.shape``
        Image with texture [dB]; the array ``image_db`` itself if no material of the image has a texture.
    """
    orders = {name: order for name, order in orders.items() if np.isfinite(order) and name in geometry.names}
    if not orders:
        return image_db
    image_db = image_db.copy()
    for name, order in orders.items():
        pixels = geometry.pixels(name)
        image_db.ravel()[pixels] = textured(image_db.ravel()[pixels], order, seed, name, fresh)
    return image_db
