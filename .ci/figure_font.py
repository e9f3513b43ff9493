"""Font of the figures: the part of DejaVu Sans with the letters and signs that figures use.

    python .ci/figure_font.py FOLDER

matplotlib embeds in each PDF file the glyphs that a figure uses. From the whole font, fontTools would read 6,000 glyphs
and tables of substitutions and positions for each file, which takes most of the time. No figure needs these tables: the
distances between letters stand in the table ``kern``. The table of names keeps the licence of DejaVu Sans, which allows
changed copies under another name.
"""

import sys
from pathlib import Path

from fontTools import subset
from matplotlib import font_manager

SIGNS = [*range(0x20, 0x180), *range(0x370, 0x400), *range(0x2000, 0x2300)]  # Latin, Greek, punctuation, mathematics


def main() -> None:
    """Write ``normal.ttf`` and ``bold.ttf``."""
    options = subset.Options(glyph_names=True, legacy_kern=True, name_IDs=["*"], recommended_glyphs=True)
    options.drop_tables += ["FFTM", "GDEF", "GPOS", "GSUB", "MATH"]
    for weight in ("normal", "bold"):
        found = font_manager.findfont(font_manager.FontProperties(family="DejaVu Sans", weight=weight))
        with subset.load_font(found, options) as font:
            part = subset.Subsetter(options)
            part.populate(unicodes=SIGNS)
            part.subset(font)
            for kind in (1, 16):  # the two names of the family
                font["name"].setName("radcal", kind, 3, 1, 0x409)
            subset.save_font(font, str(Path(sys.argv[1], f"{weight}.ttf")), options)


if __name__ == "__main__":
    main()
