"""The learner: a double dueling DQN that knows an EnvBase and a drawing function, not the simulator."""
