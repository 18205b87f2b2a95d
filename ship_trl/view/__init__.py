"""Pictures for people: the scene drawn large, an episode as GIF, the learning curve, all cases at once."""
