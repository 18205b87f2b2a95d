"""The simulator: geometry, dynamics, reward, drawing. It knows nothing of learning."""
