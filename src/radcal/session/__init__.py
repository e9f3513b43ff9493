"""One command on a case: check, lock, repair, jobs, progress."""
