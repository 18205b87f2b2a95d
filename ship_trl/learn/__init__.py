"""The learner: a double dueling DQN. It needs an EnvBase and a drawing function, not the simulator."""
