"""A case written from answers and from what its files say."""
