"""Benchmark data sets: drawn from a spec, built without loss, checked, exported and scored."""
