"""`python -m ship_trl export POLICY FILE.onnx [target=CASE]`: convert a network to ONNX.

POLICY is a result folder (its best network, on its own target) or a safetensors file. The model maps
`pixels`, uint8 [batch, C, 84, 84], to `action_value`, the float32 Q-values [batch, A]; or, of a network that
sees numbers, `vector`, float32 [batch, F]. Its metadata has the actions' speeds and rates of turn. If
onnxruntime is installed, model and network are compared on a whole episode, and a model that differs is not
written.
"""

from __future__ import annotations

import importlib.util
import sys

from ship_trl.cli.errors import refusals
from ship_trl.cli.parser import add_output, make_parser
from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.run.entries import drop_last_networks, find_entries

REQUIRED = ("onnx", "onnxscript")


def main(arguments: list[str] | None = None) -> None:
    """Read the words, export the network, and print what was written."""
    parser = make_parser("export", __doc__)
    parser.add_argument("policy", metavar="POLICY", help="a result folder or a safetensors file")
    add_output(parser, "file", (".onnx",), "the model to write")
    case = "of a file: a case to check it on"
    parser.add_argument("target", nargs="*", default=[], metavar="target=CASE", help=case)
    parser.add_argument("--colour", action="store_true", help="the network of a file sees colours")
    options = parser.parse_args(arguments)
    with refusals():
        for name in REQUIRED:
            if importlib.util.find_spec(name) is None:
                raise ConfigError(missing_extra(name, "onnx"))
        entries = drop_last_networks(find_entries([options.policy, *options.target], options.colour))
        if len(entries) > 1:
            raise ConfigError(f"policy: {options.policy} has several results or cases; allowed: one of each")

        from ship_trl.policies.export import export
        from ship_trl.run.process import configure_process

        configure_process()
        sys.stdout.write(f"{export(entries[0], options.file)}\n")
