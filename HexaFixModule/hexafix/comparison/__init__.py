"""The benchmark page: what `hexafix.benchmark.comparison` measured, as text and picture."""
