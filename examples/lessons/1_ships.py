# %% [markdown]
# # Ships in five minutes
#
# Own ship must reach its goal, and no target ship may come within the safe distance of 45 m. Here a trained
# network steers it, is compared with planners on encounters that it never met, and is filmed. Nothing is
# trained. Pictures and films go to `outputs/lessons`.
#
# ## Make an environment
#
# Case 4 has two ships that come from starboard. Own ship chooses one of seven actions each second: a turn
# and a speed. It sees 84 x 84 grey pixels, its own course up.

# %%
from pathlib import Path

import gymnasium
from PIL import Image

import ship_trl

NAME = "ship_trl.gym:ShipCollision-v0"
folder = Path("outputs/lessons")
folder.mkdir(parents=True, exist_ok=True)

env = gymnasium.make(NAME, case="4", render_mode="rgb_array")
pixels, info = env.reset(seed=0)
print(f"{env.action_space}, observation {pixels.shape}, {pixels.dtype}")
Image.fromarray(env.render()).resize((400, 400)).save(folder / "map.png")
Image.fromarray(pixels[..., 0]).resize((400, 400), Image.Resampling.NEAREST).save(folder / "pixels.png")

# %% [markdown]
# ![The map of case 4](pictures/map.png) ![The pixels of case 4](pictures/pixels.png)
#
# Left `map.png`, for people: own ship is white, target ships are green. Right `pixels.png`, what a network
# sees.
#
# ## Let a trained network act
#
# `traffic` is a bundled network that learned from numbers on random encounters. `policy.env_options` says
# which observation it needs.

# %%
policy = ship_trl.load_policy("traffic")
env = gymnasium.make(NAME, case="4", **policy.env_options)
observation, info = env.reset(seed=0)
total, is_over = 0.0, False
while not is_over:
    action, _ = policy.predict(observation)
    observation, reward, terminated, truncated, info = env.step(action)
    total, is_over = total + float(reward), terminated or truncated
print(f"return {total:.1f}, goal {info['goal']}, least distance {info['least_distance']:.0f} m")

# %% [markdown]
# ## Judge it
#
# One episode says little. `ship-trl evaluate` rolls out policies in all scenes of a suite; here it is
# called as a function. `imazu` holds the 22 Imazu problems, the usual test of collision avoidance. Compared
# are a ship that holds its course, and two planners: velocity obstacles (`vo`) and model predictive control
# (`sb_mpc`).

# %%
from ship_trl.cli.evaluate import main as evaluate

SUITE = "imazu"
evaluate(["pretrained:traffic", "vo", "sb_mpc", "keep_course", f"target={SUITE}"])

# %% [markdown]
# *Success* is the share of scenes in which own ship reached its goal without a collision, with its 95 %
# interval. The last column has the mean of the least distance to a target ship, and its 5th percentile.
# `target=traffic_test` has 500 random encounters, `--rules` adds scores by the steering rules ([what is
# measured](../../docs/encounters.md#what-is-measured)).
#
# ## Film it

# %%
from ship_trl.cli.record import main as record

record(["pretrained:traffic", "target=imazu18", "--size", "640x360", "--output", str(folder / "imazu18.gif")])

# %% [markdown]
# ![The network in Imazu problem 18](pictures/imazu18.gif)
#
# ## Go on
#
# - `ship-trl watch pretrained:traffic target=imazu` shows all problems in a window, `ship-trl play
#   target=4` lets you steer.
# - [Transfer](2_transfer.py): what a network learned on one encounter, carried to another.
# - [Your own encounter](3_own_encounter.py).
