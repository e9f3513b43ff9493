"""radcal's own files: written atomically, sealed with a checksum, locked, listed."""
