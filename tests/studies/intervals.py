"""What studies of real scans compare readings by."""
import math


def standard_deviations(first, second):
    """By how many of both two readings differ, each a value with the ends of its 95 % interval. Of an interval with unequal
    halves the half counts that faces the other number."""
    (_, _, top), (_, bottom, _) = lower, upper = sorted((first, second))
    both = math.hypot(top - lower[0], upper[0] - bottom) / 1.96
    return (upper[0] - lower[0]) / both if both > 0 else math.inf
