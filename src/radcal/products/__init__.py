"""What is made from a finished calibration: exports, forward runs, predictions, advice, comparisons."""
