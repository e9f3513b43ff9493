"""Moving targets on the ground, from the signals of several channels along the track."""
