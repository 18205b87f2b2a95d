"""Compiled loops of the simulator, behind the interfaces of `ship_trl.sim`."""
