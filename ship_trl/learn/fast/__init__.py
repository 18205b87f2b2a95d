"""What makes the learner fast on a CPU, behind the interfaces of `ship_trl.learn`."""
