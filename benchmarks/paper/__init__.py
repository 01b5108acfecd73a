"""The experiments of the paper, section 5: `python -m benchmarks.paper --out DIR`."""
