"""Paste printed commands into a real shell."""

import re
import subprocess

from hydra.core.override_parser.overrides_parser import OverridesParser

# Names of folders and cases that a shell or Hydra's grammar may read as something else.
ODD = (
    "my runs", "a[1]", "{b}", "(c)", "münchen", "a=b", "1_0", "1e3", "2024_05_01", "045", ".5", "true",
    "null", "it's", 'a"b', "a,b", "a:b", "$HOME", "`id`", "back\\slash", "end\\", "~", "a;b", "a&b", "*",
    "#1", "a!b", "-3",
)  # fmt: skip


def pasted(line: str) -> list[str]:
    """Return the words that a shell gives to `python -m ship_trl`."""
    stub = 'python() { [ "$1 $2" = "-m ship_trl" ] && shift 2 && printf "%s\\0" "$@"; }'
    done = subprocess.run(["bash", "-c", f"{stub}\n{line}"], capture_output=True, text=True, check=True)
    return done.stdout.split("\0")[:-1]


def composed_values(line: str) -> dict[str, str]:
    """Return the overrides of a printed run, as the shell and then Hydra read them."""
    found = OverridesParser.create().parse_overrides(pasted(line))
    return {one.key_or_group: str(one.value()) for one in found}


def printed_commands(text: str) -> list[str]:
    """Find the commands in what was printed."""
    return re.findall(r"python -m ship_trl .*", text)
