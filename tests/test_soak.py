"""The soak sees what grows."""

import pytest

from tests.soak import MEASURED, grown

FLAT = (400.0, 12.0, 3.0, 1.0)


def test_what_stays_is_not_named() -> None:
    # What is loaded at the beginning is no growth.
    assert grown([(100.0, 5.0, 1.0, 1.0)] * 20 + [FLAT] * 80) == []


@pytest.mark.parametrize("column", range(len(MEASURED)))
def test_what_grows_is_named(column: int) -> None:
    rows = [
        tuple(value + (n if place == column else 0) for place, value in enumerate(FLAT)) for n in range(100)
    ]
    found = grown(rows)  # type: ignore[arg-type]
    assert len(found) == 1 and found[0].startswith(MEASURED[column])
