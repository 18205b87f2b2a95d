"""Speed and memory of ship_trl beside other libraries that do the same work on the same processor."""
