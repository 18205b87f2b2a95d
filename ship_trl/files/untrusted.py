"""Files that a stranger may have written: YAML as plain values, and streams that end. No torch.

SECURITY.md says what is promised of such files, tests/test_outside.py holds it.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

import yaml
from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from ship_trl.files.disk import read_file

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

# Bytes of a YAML file, at most: a run's configuration has two thousand, a case of eight ships 700.
LARGEST_YAML = 64_000
# Lists and mappings within each other, at most: a configuration has four.
DEEPEST_YAML = 50


def read_yaml(path: Path) -> DictConfig | ListConfig:
    """Read a YAML file, as OmegaConf does, but without what is more than a value.

    OmegaConf's loader makes no Python objects: it is a `yaml.SafeLoader`. But `${oc.env:NAME}` would read
    this machine's environment into what is printed and kept, and a few aliases can stand for billions of
    values.

    Raises:
        yaml.YAMLError: it is not YAML, too large or too deep, or holds an interpolation or an alias.
        OSError: it cannot be read.
    """
    if path.is_file() and path.stat().st_size > LARGEST_YAML:
        raise yaml.YAMLError(f"larger than {LARGEST_YAML} bytes")
    data = read_file(path)
    try:
        text = data.decode()
        refuse_more_than_values(text)
        return OmegaConf.load(io.StringIO(text))
    except AssertionError:  # OmegaConf's, of a number in quotes
        raise yaml.YAMLError("a single value") from None
    except (OmegaConfBaseException, ValueError, LookupError, TypeError, AttributeError) as error:
        # No UTF-8, a number of thousands of digits, `!!int x`, of which PyYAML makes Python's own errors.
        raise yaml.YAMLError(str(error)) from None


def refuse_more_than_values(text: str) -> None:
    """Refuse interpolations, however they are escaped, aliases, and what is nested too deeply.

    Raises:
        yaml.YAMLError: there is one, or it is not YAML.
    """
    depth = 0
    for event in yaml.parse(text, Loader=yaml.SafeLoader):
        line = event.start_mark.line + 1 if event.start_mark else 0
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > DEEPEST_YAML:
            raise yaml.YAMLError(f"line {line}: nested too deeply")
        if isinstance(event, yaml.AliasEvent):
            raise yaml.YAMLError(f"line {line}: no alias (*{event.anchor}) is allowed")
        if isinstance(event, yaml.ScalarEvent) and "${" in event.value:
            raise yaml.YAMLError(f"line {line}: no interpolation (${{...}}) is allowed")


class Bounded(io.RawIOBase):
    """A binary stream that gives no more than `most` bytes: what is packed may be far larger than its file.

    Raises:
        ValueError: at reading, there are more.
    """

    def __init__(self, stream: io.BufferedIOBase, most: int) -> None:
        self._stream, self._left, self._most = stream, most, most

    def readable(self) -> bool:
        """Answer that it is read, and nothing else."""
        return True

    def readinto(self, buffer: WriteableBuffer) -> int:
        """Fill a buffer, or a part of it."""
        view = memoryview(buffer).cast("B")
        data = self._stream.read(len(view))
        view[: len(data)] = data
        self._left -= len(data)
        if self._left < 0:
            raise ValueError(f"unpacked it has more than {self._most} bytes")
        return len(data)
