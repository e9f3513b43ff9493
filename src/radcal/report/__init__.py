"""Archive, table of runs, summary, figures and HTML report."""
