"""Fast CPU implementations, behind the interfaces of `ship_trl.learn`."""
