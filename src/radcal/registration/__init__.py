"""Registration of the measured image onto the simulated one, and checks of the geometry that it shows."""
