"""Materials that are mixtures of base materials, in YAML, on standard output."""

import argparse
import sys
from pathlib import Path

import yaml

from radcal.cdb.mapping import CdbMapping
from radcal.cdb.mixtures import mixed_laws
from radcal.errors import RadcalError
from radcal.vectors.mapping import read_mapping

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("mapping", type=Path)
parser.add_argument("root", type=Path)
parser.add_argument("bounds", type=float, nargs=4, metavar=("west", "south", "east", "north"))
arguments = parser.parse_args()
try:
    mapping = read_mapping(arguments.mapping, "mapping", CdbMapping)
    laws, said = mixed_laws(arguments.root, tuple(arguments.bounds), mapping)
except RadcalError as error:
    sys.exit(f"radcal: {error}")
sys.stdout.writelines(f"# {line}\n" for line in said)
sys.stdout.write(yaml.safe_dump({"materials": laws}, sort_keys=False, default_flow_style=None, width=110))
