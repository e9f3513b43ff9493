"""Plan-position indicator: picture of a surveillance radar on a mast, from the scene and the laws of a case."""
