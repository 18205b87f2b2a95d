"""Inference in float32 on a few frames, for acting and encoding."""

from __future__ import annotations

import torch
from torch import Tensor

from ship_trl.learn.fast.incremental import as_matrix, gathered_layer
from ship_trl.learn.fast.weights_version import untracked_writes, weights_version
from ship_trl.learn.fast.windows import Rows, WindowExtractor
from ship_trl.learn.network import DuelingNetwork


class CachedInference:
    """Computes only what differs from the background, and caches the background's activations.

    The network must be on the CPU in float32: for few rows that is as fast as bfloat16, and needs no copies
    of the weights. Its first `frozen` conv layers never learn.
    """

    def __init__(self, network: DuelingNetwork, background: Tensor, frozen: int) -> None:
        self._network, self._frozen = network, frozen
        self._extract = WindowExtractor(background, torch.float32, network.geometry)
        self._background_frame = self._extract(background.unsqueeze(0))
        self._background_cache: list[Tensor] = []
        weights = network.conv_weights()
        self._weights = [
            (as_matrix(weight.detach()), bias.detach())
            for weight, bias in zip(weights[::2], weights[1::2], strict=True)
        ]
        self._learning = weights[2 * frozen :]
        self._version: tuple[int, ...] = ()
        self._untracked_writes = untracked_writes()

    def _drop_stale(self) -> None:
        """Drop the cached activations of layers whose weights have changed."""
        now, writes = weights_version(self._learning), untracked_writes()
        if now != self._version:
            # Loading or moving the network changes the frozen layers too.
            del self._background_cache[self._frozen if writes == self._untracked_writes else 0 :]
            self._version, self._untracked_writes = now, writes

    @torch.no_grad()
    def actions(self, frames: Tensor) -> Tensor:
        """Choose the best actions: uint8 [B, C, 84, 84] to int64 [B]."""
        rows = self._extract(frames, background=False)
        return self._network.best_actions(self._compute_layers(rows, len(rows.indices)).values)

    @torch.no_grad()
    def actions_from_features(self, features: Tensor) -> Tensor:
        """Choose the best actions from features of the frozen layers: [B, K] to int64 [B]."""
        rows = Rows(features.float(), (None,) * (len(self._weights) - self._frozen))
        return self._network.best_actions(self._compute_layers(rows, len(rows.indices)).values)

    @torch.no_grad()
    def encode(self, frames: Tensor) -> Tensor:
        """Compute the frozen layers (`linear_from` or more): uint8 [B, C, 84, 84] to float32 [B, K]."""
        values, indices = self._compute_layers(self._extract(frames, background=False), self._frozen)
        if indices and indices[0] is not None:
            values = values[indices[0]].flatten(1)
        return values

    def _compute_layers(self, rows: Rows, layers: int) -> Rows:
        """Compute the next `layers` conv layers."""
        self._drop_stale()
        values, indices = rows
        first = len(self._weights) - len(indices)
        for n in range(first, first + layers):
            _, values = gathered_layer(values, indices[n - first], *self._weights[n])
            if n < len(self._extract.sides):
                values = torch.cat((self._background_rows(n), values))
        return Rows(values, indices[layers:])

    def _background_rows(self, layer: int) -> Tensor:
        """Return the background's activations after conv layer `layer`, counted from 0: [S * S, C]."""
        cached = self._background_cache
        while len(cached) <= layer:
            n = len(cached)
            below = cached[-1] if cached else self._background_frame.values
            _, rows = gathered_layer(below, self._background_frame.indices[n], *self._weights[n])
            cached.append(rows[: self._extract.sides[n] ** 2])
        return cached[layer]
