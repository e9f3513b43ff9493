"""Backscatter laws, acquisition geometry, speckle and image formation."""
