"""Methods of transfer (section 3.5), a file each: what is copied, what learns, what the loss adds."""

from __future__ import annotations

from pkgutil import resolve_name

from ship_trl.config.arm import FORMS, Arm
from ship_trl.config.transfer import Transfer
from ship_trl.transfer.methods.base import TransferMethod


def make_method(arm: Arm, settings: Transfer | None = None) -> TransferMethod:
    """Make the method of an arm, with its settings or the default ones."""
    make: type[TransferMethod] = resolve_name(f"{__name__}.{FORMS[arm.method].hooks}")
    return make(arm, settings or Transfer())
