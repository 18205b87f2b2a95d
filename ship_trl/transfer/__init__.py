"""Transfer: which layers are copied, which source to take, where trained networks are kept."""
