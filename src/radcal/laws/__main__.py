"""Table of all laws in Markdown, on standard output."""

import sys

from radcal.laws import laws_table

sys.stdout.write(laws_table())
