"""Ground of a material in the image: usable pixels, fields, intervals of incidence, correlation, levels."""
