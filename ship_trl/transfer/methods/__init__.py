"""Methods of transfer (section 3.5), one file each: what is copied, what learns, what the loss adds."""

from __future__ import annotations

from ship_trl.config.arm import Arm, Method
from ship_trl.transfer.methods.feature_extraction import FeatureExtraction
from ship_trl.transfer.methods.finetune import Finetune
from ship_trl.transfer.methods.method import TransferMethod
from ship_trl.transfer.methods.scratch import Scratch

METHODS: dict[Method, type[TransferMethod]] = {
    Method.scratch: Scratch,
    Method.feature_extraction: FeatureExtraction,
    Method.finetune: Finetune,
}


def make_method(arm: Arm) -> TransferMethod:
    """Make the method of an arm."""
    return METHODS[arm.method](arm)
