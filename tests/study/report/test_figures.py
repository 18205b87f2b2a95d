"""How a report's figures are written."""

import errno
import resource
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from ship_trl.study.report.figures import save


def test_a_disk_that_has_no_room_for_the_pdf_is_said_and_the_last_one_kept(tmp_path: Path) -> None:
    figure = Figure(figsize=(1, 1))
    # Longer than what is kept in memory until it is written.
    figure.add_subplot().plot(np.random.default_rng(0).random(20_000))
    picture, document = save(figure, tmp_path / "figure")
    kept = document.read_bytes()
    room, hard = len(kept) // 2, resource.getrlimit(resource.RLIMIT_FSIZE)[1]
    assert picture.stat().st_size < room
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, hard))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            save(figure, tmp_path / "figure")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    assert caught.value.errno == errno.EFBIG
    assert document.read_bytes() == kept and len(list(tmp_path.iterdir())) == 2
