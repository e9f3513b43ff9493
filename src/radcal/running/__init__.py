"""One command on a case: lock, repair, jobs, terminal, cluster."""
