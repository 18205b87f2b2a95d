"""The simulator: geometry, dynamics, reward, drawing and environments. It imports nothing of learning."""
