"""Waiting for what processes bring about."""

import time


def wait_until(condition, process=None, seconds=300.0):
    """What a condition gives once it gives something; a process that is to meet it may not end before."""
    deadline = time.time() + seconds
    while not (found := condition()):
        assert process is None or process.poll() is None, "the process ended before"
        assert time.time() < deadline
        time.sleep(0.02)
    return found
