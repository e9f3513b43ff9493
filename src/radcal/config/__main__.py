"""Writes the default case: ``python -m radcal.config > config/config.yaml``."""

import sys

from radcal.config.writing import default_yaml

sys.stdout.write(default_yaml())
