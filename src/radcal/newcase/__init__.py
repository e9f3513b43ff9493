"""A new case from options and from what its files say."""
