"""Measured images: readers of formats, and what their pixels and metadata say."""
