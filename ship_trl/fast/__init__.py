"""Fast implementations, behind the interfaces of `sim` and `learn`, which are handed them."""
