"""What map viewers show of an image: names and colours of its classes, or the ends of its gray scale."""

from __future__ import annotations

from collections.abc import Mapping

from lxml import etree

Classes = Mapping[int, tuple[str, str]]
"""Name and colour (``#RRGGBB``) of each class by its number, from 1."""


def category_names(classes: Classes) -> bytes:
    """Content of GDAL's file ``.aux.xml`` with the names of the classes, for which GeoTIFF itself has no place.

    Parameters
    ----------
    classes : mapping
        Classes by number.

    References
    ----------
    GDAL documentation, raster data model, category names; https://gdal.org/en/stable/user/raster_data_model.html
    """
    root = etree.Element("PAMDataset")
    names = etree.SubElement(etree.SubElement(root, "PAMRasterBand", band="1"), "CategoryNames")
    for value in range(max(classes) + 1):
        etree.SubElement(names, "Category").text = classes[value][0] if value in classes else None
    return bytes(etree.tostring(root, pretty_print=True))


def class_style(classes: Classes) -> bytes:
    """Style of an image of classes for QGIS, with the names and colours of the classes alone."""
    renderer = etree.Element("rasterrenderer", type="paletted", band="1", opacity="1", alphaBand="-1")
    palette = etree.SubElement(renderer, "colorPalette")
    for value, (name, colour) in classes.items():
        etree.SubElement(palette, "paletteEntry", value=str(value), color=colour, alpha="255", label=name)
    return _style(renderer)


def gray_style(black: float, white: float) -> bytes:
    """Style of an image for QGIS in shades of gray.

    Parameters
    ----------
    black, white : float
        Values that are shown in black and in white.
    """
    renderer = etree.Element(
        "rasterrenderer", type="singlebandgray", grayBand="1", gradient="BlackToWhite", opacity="1", alphaBand="-1"
    )
    contrast = etree.SubElement(renderer, "contrastEnhancement")
    etree.SubElement(contrast, "minValue").text = f"{black:g}"
    etree.SubElement(contrast, "maxValue").text = f"{white:g}"
    etree.SubElement(contrast, "algorithm").text = "StretchToMinimumMaximum"
    return _style(renderer)


def _style(renderer: etree._Element) -> bytes:
    """Content of a ``.qml`` file that has only a renderer."""
    root = etree.Element("qgis", styleCategories="Symbology")
    etree.SubElement(root, "pipe").append(renderer)
    return bytes(etree.tostring(root, pretty_print=True, doctype="<!DOCTYPE qgis>"))
