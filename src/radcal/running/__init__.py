"""Support of one Snakemake command on a case: lock, check of earlier results, jobs, terminal output, cluster."""
