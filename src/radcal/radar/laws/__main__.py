"""Table of all laws in Markdown, on standard output."""

import sys

from radcal.radar.laws import laws_table

sys.stdout.write(laws_table())
