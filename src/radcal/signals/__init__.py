"""Raw radar signals of a scene, and images focused from them.

Coordinates are metres along the track (azimuth, from the near edge of the scene's first line), in ground range from
below the nominal track, and in elevation. The earth is flat, the track straight but for motion errors, and transmitter
and receiver are at one place. Signals are range-compressed spectra: of each pulse, the samples over frequency.
"""
