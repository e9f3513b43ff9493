"""Files that the manifest of a SAFE folder lists."""

import os

import pytest
from safe_product import STEM, write_product

from radcal.sentinel1.safe import chosen_image, safe_folder, safe_images


@pytest.mark.parametrize("inside", ["", "manifest.safe"])
def test_images_are_those_of_the_manifest(tmp_path, inside):
    safe = write_product(tmp_path)
    images = safe_images(safe / inside)
    assert [image.polarisation for image in images] == ["VV", "VH"]
    image = chosen_image(images, "VV")
    assert image.files == (
        safe / f"annotation/{STEM}.xml",
        safe / f"annotation/calibration/calibration-{STEM}.xml",
        safe / f"annotation/calibration/noise-{STEM}.xml",
        safe / f"measurement/{STEM}.tiff",
    )
    assert safe_folder(safe / inside) == safe


def test_only_whole_images_are_offered(tmp_path):
    with pytest.raises(ValueError, match=r"^it has VV, radar\.polarisation is HV$"):
        chosen_image(safe_images(write_product(tmp_path)), "HV")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<XFDU/>", "lists no measured image"),
        ("no XML", "its XML cannot be parsed"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><a>&b;</a>', "declares a document type"),
    ],
)
def test_other_manifests_are_refused(tmp_path, text, words):
    (tmp_path / "manifest.safe").write_text(text)
    with pytest.raises(ValueError, match=words):
        safe_images(tmp_path)


def test_a_manifest_elsewhere_is_not_read(tmp_path):
    safe = write_product(tmp_path)
    (safe / "manifest.safe").rename(tmp_path / "other.xml")
    (safe / "manifest.safe").symlink_to("../other.xml")
    with pytest.raises(ValueError, match=r"^manifest\.safe is a link to .*/other\.xml, expected a file of the folder$"):
        safe_images(safe)
    (safe / "manifest.safe").unlink()
    os.mkfifo(safe / "manifest.safe")  # a program that reads it waits for ever
    with pytest.raises(ValueError, match=r"^manifest\.safe: it is a folder or a device, expected a file$"):
        safe_images(safe)


def test_a_manifest_of_gigabytes_is_not_read(tmp_path):
    with (tmp_path / "manifest.safe").open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(ValueError, match=r"^manifest\.safe: it has 1099511627776 bytes, expected at most 100000000$"):
        safe_images(tmp_path)


def test_an_image_without_its_tables_is_refused(tmp_path):
    safe = write_product(tmp_path)
    manifest = safe / "manifest.safe"
    manifest.write_text(manifest.read_text().replace(f"/noise-{STEM}", "/noise-other"))
    with pytest.raises(ValueError, match=f"lists no noise of {STEM}.tiff"):
        safe_images(safe)
