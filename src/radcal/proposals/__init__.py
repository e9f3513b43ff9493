"""Design, surrogate, and the search for proposals on it."""
