"""External programs as simulators: command, files, placeholders, process, image that they write."""
