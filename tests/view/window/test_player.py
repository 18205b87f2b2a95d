"""The position of a player: no window, no clock."""

from hypothesis import given
from hypothesis import strategies as st

from ship_trl.view.window.player import SPEEDS, Player


def state(player: Player) -> tuple[float, bool]:
    return player.position, player.running


def test_it_runs_at_its_speed_and_stops_at_the_end() -> None:
    player = Player(steps=10, dt=0.5, speed=2.5)
    player.advance(0.5)
    assert state(player) == (2.5, True)
    # From between two steps, back is to the one that began last.
    player.step(-1)
    assert state(player) == (2.0, False)
    player.advance(100.0)
    player.step()
    assert state(player) == (3.0, False)
    player.pause()
    player.advance(100.0)
    assert state(player) == (10.0, False)
    player.pause()
    assert state(player) == (0.0, True)


def test_speed_has_levels_and_stays_for_the_next_episode() -> None:
    player = Player(steps=3)
    for _ in SPEEDS:
        player.change_speed(1)
    assert player.speed == SPEEDS[-1]
    for _ in range(2 * len(SPEEDS)):
        player.change_speed(-1)
    player.seek(3)
    player.load(7, 0.5)
    assert (*state(player), player.speed, player.steps) == (0.0, True, SPEEDS[0], 7)


@given(st.lists(st.sampled_from(["pause", "step", "back", "restart", "wait", "seek"])))
def test_it_never_leaves_the_episode_and_stands_on_whole_steps(keys: list[str]) -> None:
    player = Player(steps=4)
    does = {
        "pause": player.pause,
        "step": player.step,
        "back": lambda: player.step(-1),
        "restart": player.restart,
        "wait": lambda: player.advance(0.13),
        "seek": lambda: player.seek(99),
    }
    for key in keys:
        does[key]()
        assert 0 <= player.position <= 4
        assert player.running or player.position == int(player.position)
