"""Texture of materials with fixed laws, multiplied onto the pixels of a simulated image."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from radcal.config import Material, Radar
from radcal.radar.geometry import Geometry
from radcal.radar.texture import equal_texture, texture_db, texture_order
from radcal.seeds import derived_rng

__all__ = ["orders_of", "with_textures"]


def orders_of(materials: Mapping[str, Material], first: Radar, radar: Radar) -> dict[str, float]:
    """Order of the gamma texture of each material with the key ``looks``.

    Parameters
    ----------
    materials : mapping
        Section ``materials``.
    first : Radar
        First pass, for whose image the key states the effective looks.
    radar : Radar
        Pass of the image, whose speckle may have other looks.

    Returns
    -------
    dict
        Order by material (:func:`radcal.radar.texture.texture_order`), infinite where the looks need no texture.
    """
    return {
        name: texture_order(radar.looks, equal_texture(first.looks, material.looks, radar.looks))
        for name, material in materials.items()
        if material.looks is not None
    }


def with_textures(
    image_db: NDArray[np.float32], geometry: Geometry, orders: Mapping[str, float], noise_seed: int
) -> NDArray[np.float32]:
    """Image with gamma texture of unit mean on all pixels that contain a textured material alone.

    Parameters
    ----------
    image_db : ndarray of float32, shape ``geometry.shape``
        Simulated image [dB].
    geometry : Geometry
        Geometry of the pass, which states the pixels of each material.
    orders : mapping
        Order of the texture by material (:func:`orders_of`).
    noise_seed : int
        Seed of the image's speckle, from which the random numbers of the texture derive.

    Returns
    -------
    ndarray of float32
        The same array where no material of the image has a texture.
    """
    orders = {name: order for name, order in orders.items() if np.isfinite(order) and name in geometry.names}
    if not orders:
        return image_db
    textured = image_db.copy()
    values = textured.reshape(-1)
    for name, order in orders.items():
        pixels = geometry.pixels(name)
        uniform = derived_rng(noise_seed, "texture", name).random(pixels.size)
        values[pixels] = values[pixels] + texture_db(uniform, order)
    return textured
