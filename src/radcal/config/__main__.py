"""Command that prints the default case or the JSON schema, both generated from the configuration models.

python -m radcal.config > config/config.yaml              the default case
python -m radcal.config schema > config/schema.json       the schema for editors
"""

import sys

from radcal.config.schema import schema_json
from radcal.config.writing import default_yaml

match sys.argv[1:]:
    case []:
        sys.stdout.write(default_yaml())
    case ["schema"]:
        sys.stdout.write(schema_json())
    case words:
        sys.exit(f"python -m radcal.config: {' '.join(words)!r} is unknown, expected schema or nothing.")
