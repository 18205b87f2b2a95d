"""Methods of transfer (section 3.5), a file each: what is copied, what learns, what the loss adds.

A file has `FORM`, the method's names and settings, and `Method`, what it does. It is imported before torch.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

from ship_trl.config.arm import Arm, forms
from ship_trl.transfer.methods.base import TransferMethod


def make_method(arm: Arm, transfer: Any = None) -> TransferMethod:
    """Make the method of an arm, with its settings in `Config.transfer` or the default ones."""
    if arm.is_scratch:
        return TransferMethod(arm)
    method: TransferMethod = import_module(f"{__name__}.{arm.method}").Method(arm)
    if kind := forms()[arm.method].settings:
        method.settings = getattr(transfer, arm.method, kind())
    return method
