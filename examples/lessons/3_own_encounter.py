# %% [markdown]
# # From your own encounter to a film
#
# An encounter is a YAML file. Here one is written, looked at, and sailed by planners and a trained network.
# The whole lesson takes two minutes, without training.
#
# ## Write the encounter
#
# Places are in metres (x east, y north), courses in degrees clockwise from north, speeds in m/s. Own ship
# makes up to 15 m/s. Here a ferry crosses from starboard, to which own ship must give way, and a slow ship
# lies ahead.

# %%
from pathlib import Path

folder = Path("outputs/lessons")
folder.mkdir(parents=True, exist_ok=True)
ferry = folder / "ferry.yaml"
ferry.write_text("""\
start: [0, 0]
course: 000
goal: [0, 600]
ideal_path: starboard        # a name of your own: cases of one name count as similar
target_ships:
  - {x: 300, y: 300, course: 270, speed: 14}    # the ferry
  - {x: -20, y: 200, course: 000, speed: 4}     # the slow ship
""")

# %% [markdown]
# ## Look at it

# %%
import gymnasium
from PIL import Image

env = gymnasium.make("ship_trl.gym:ShipCollision-v0", case=str(ferry), render_mode="rgb_array")
env.reset()
Image.fromarray(env.render()).resize((400, 400)).save(folder / "ferry.png")

# %% [markdown]
# ![The encounter: own ship is white, the others are green](pictures/ferry.png)
#
# ## Compare policies
#
# `keep_course` shows what happens if nobody does anything. `vo`, `sb_mpc` and `apf` are planners, and
# `pretrained:traffic` learned on random encounters; none has seen this one.

# %%
from ship_trl.cli.evaluate import main as evaluate

POLICIES = ["keep_course", "vo", "sb_mpc", "apf", "pretrained:traffic"]
evaluate([*POLICIES, f"target={ferry}"])

# %% [markdown]
# One scene may be luck. `perturbation` draws starts around it, here 20 m to each side and 1 m/s of the
# ships' speed:

# %%
EPISODES = 100
around = ["perturbation.ship_position=20", "perturbation.ship_speed=1", "--episodes", str(EPISODES)]
evaluate([*POLICIES, f"target={ferry}", *around, "--rules"])

# %% [markdown]
# R8 to R17 are scores by the steering rules, from 0 to 1: R8 asks for an early and clear action, R13 is
# about overtaking, R14 to R17 about meeting and crossing ([what is
# measured](../../docs/encounters.md#what-is-measured)).
#
# ## Film it
#
# Two policies side by side (`outputs/lessons/ferry.gif`), and the paths of all in one chart:

# %%
from ship_trl.cli.record import main as record

film, chart = folder / "ferry.gif", folder / "ferry_paths.png"
record(["vo", "pretrained:traffic", f"target={ferry}", "--compare", "--output", str(film)])
record([*POLICIES, f"target={ferry}", "--trajectories", str(chart)])

# %% [markdown]
# ![The paths of all five policies](pictures/ferry_paths.png)
#
# ## Go on
#
# - `ship-trl cases target=outputs/lessons/ferry.yaml` ranks sources to transfer from. It takes minutes,
#   because it searches for the best plan.
# - Train on it, from numbers:
#   `ship-trl target=outputs/lessons/ferry.yaml method=scratch observation=vector`.
# - Several cases make a [suite](../../CONTRIBUTING.md#add-a-suite), which may be a target like any case.
# - A policy of your own is [a function](../../docs/library.md#policies): `ship-trl evaluate mine.py:policy`.
