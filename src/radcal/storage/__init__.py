"""Files that radcal writes and reads: atomic writes, checksums, locks, run records and run store."""
