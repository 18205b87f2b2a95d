"""Finetuning: copied layers learn as all others do (section 3.5)."""

from __future__ import annotations

from ship_trl.config.arm import Form
from ship_trl.transfer.methods.base import TransferMethod

FORM = Form("FT")
Method = TransferMethod
