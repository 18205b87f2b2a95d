"""Methods of transfer (section 3.5): what is copied, what learns, what the loss adds."""

from __future__ import annotations

from ship_trl.config.arm import Arm, Method
from ship_trl.config.transfer import Transfer
from ship_trl.transfer.methods.feature_extraction import FeatureExtraction
from ship_trl.transfer.methods.guide import Guide
from ship_trl.transfer.methods.l2sp import L2SP
from ship_trl.transfer.methods.method import TransferMethod
from ship_trl.transfer.methods.q_reuse import QReuse
from ship_trl.transfer.methods.qdagger import QDagger
from ship_trl.transfer.methods.unfreeze import Unfreeze

# From scratch nothing is copied, and finetuning copies only: both are what every method is.
METHODS: dict[Method, type[TransferMethod]] = {
    Method.scratch: TransferMethod,
    Method.feature_extraction: FeatureExtraction,
    Method.finetune: TransferMethod,
    Method.unfreeze: Unfreeze,
    Method.l2sp: L2SP,
    Method.guide: Guide,
    Method.qdagger: QDagger,
    Method.q_reuse: QReuse,
}


def make_method(arm: Arm, settings: Transfer | None = None) -> TransferMethod:
    """Make the method of an arm, with its settings or the default ones."""
    return METHODS[arm.method](arm, settings or Transfer())
