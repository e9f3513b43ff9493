"""What a person gets: archive, table, summary, figures, report."""
