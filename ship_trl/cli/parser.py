"""One way of reading a verb's arguments."""

from __future__ import annotations

import argparse
import sys
from typing import NoReturn

from ship_trl.config.errors import print_error


def make_parser(verb: str, description: str | None) -> argparse.ArgumentParser:
    """Of a command's options; what is wrong with them is one line and exit code 1, as everywhere."""

    class Parser(argparse.ArgumentParser):
        def error(self, message: str) -> NoReturn:
            print_error(f"{message}; see {self.prog} --help")
            sys.exit(1)

    # Examples stand on lines of their own, which argparse would join.
    raw = "\n    " in (description or "")
    formatter = argparse.RawDescriptionHelpFormatter if raw else argparse.HelpFormatter
    return Parser(prog=f"python -m ship_trl {verb}", description=description, formatter_class=formatter)
