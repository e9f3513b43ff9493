"""radcal's own files: written atomically, with a checksum, and protected by locks."""
