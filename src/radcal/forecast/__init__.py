"""Memory, time and runs that a command will take."""
