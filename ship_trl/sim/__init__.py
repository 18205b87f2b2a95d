"""The simulator: geometry, dynamics, reward, drawing and environments. It does not import the learner."""
