import numpy as np

from radcal.speckle.gaussian import gaussian_row, seed_words


def circular_gaussian(seed, look, stream, shape):
    """Circular complex Gaussian numbers of unit mean power for a whole image, of one look and one stream."""
    n = shape[0] * shape[1]
    real, imaginary = np.empty((2, n), dtype=np.float32)
    gaussian_row(
        n,
        np.arange(n, dtype=np.uint32),
        np.full(n, stream, dtype=np.uint32),
        np.uint32(look),
        seed_words(seed),
        np.empty((2, n), dtype=np.uint32),
        real,
        imaginary,
    )
    return (real + 1j * imaginary).astype(np.complex64).reshape(shape)
