"""Every documented range, swept to its ends: ``python -m benchmarks.ranges``."""
