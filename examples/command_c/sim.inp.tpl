labels.raw 64 60       labels, one byte a pixel: rows (slant range), columns (azimuth)
20 40                  incidence of the first and of the last row [deg]
@noise_seed@ 4         seed of the speckle, looks
2                      materials in the order of their ids, X1 to X4 of each
@field.X1@ @field.X2@ @field.X3@ @field.X4@
@lake.X1@ @lake.X2@ @lake.X3@ @lake.X4@
