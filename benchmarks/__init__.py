"""Measure every figure that the project promises, on the machine at hand:
`python -m benchmarks`."""
