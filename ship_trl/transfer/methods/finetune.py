"""Finetuning: the copied layers go on learning with the others (section 3.5)."""

from __future__ import annotations

from ship_trl.transfer.methods.method import TransferMethod


class Finetune(TransferMethod):
    """Copies the arm's layers; every layer learns."""
