"""The world for Gymnasium, one ship or many.

    import gymnasium
    env = gymnasium.make("ship_trl.gym:ShipCollision-v0", case="4")

Gymnasium imports the module before the colon, which registers the name. After `import ship_trl.gym` the name
alone is enough.
"""

import gymnasium

from ship_trl.gym.env import ENV_ID
from ship_trl.sim.cases import load_world

if ENV_ID not in gymnasium.registry:
    gymnasium.register(
        ENV_ID,
        entry_point="ship_trl.gym.env:UnlimitedEnv",
        vector_entry_point="ship_trl.gym.vector:ShipCollisionVectorEnv",
        max_episode_steps=load_world().max_steps,
    )
