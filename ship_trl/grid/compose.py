"""Compose configurations by Hydra, and explain its errors in one line. No torch.

Words stay as they are typed, `arm=FT3` stands for several, and a suite brings its profile.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from typing import Any

from hydra import compose, initialize_config_dir
from hydra._internal import hydra as hydra_parts
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.config_search_path import ConfigSearchPath, SearchPathQuery
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException, OverrideParseException
from omegaconf import DictConfig, _utils
from omegaconf.errors import OmegaConfBaseException

from ship_trl.config.arm import Arm, arm_names
from ship_trl.config.checks import to_config
from ship_trl.config.errors import ConfigError, missing_extra
from ship_trl.config.paths import OWN_CONF, conf_dir, group_names
from ship_trl.config.schema import keys_at
from ship_trl.config.types import Config
from ship_trl.files.untrusted import LOADER
from ship_trl.sim.cases import profile_of

# That of conf/config.yaml.
DEFAULT_PROFILE = "quick"
# Values of other keys without a dot, and of these with one, are text: names, paths, options of groups.
NOT_TEXT = ("seed", "layers", "fast", "colour", "overwrite", "extend")
TEXT = (
    *("algorithm.teacher", "hydra.sweep.dir"),
    *("wandb.project", "wandb.entity", "wandb.folder", "wandb.group"),
)
# One name of an arm, not a list of them.
NAME_OF_ARM = re.compile(r"[\w-]+")
# Functions of Hydra's grammar whose arguments are numbers.
NUMERIC = re.compile(r"\b(range|interval|int|float|bool|json_str|sort)\s*\(")
# The extra that installs each plugin of Hydra.
EXTRAS = {"optuna": "optuna", "submitit_slurm": "slurm", "submitit_local": "slurm"}


class Loader(ConfigLoaderImpl):
    """Hydra's loader of configurations, as `use_loader` puts it in place.

    Processes of a grid get it with their run, so that they compose alike.
    """

    def __init__(self, config_search_path: ConfigSearchPath) -> None:
        """Look into the working directory's conf/ too, after all other folders and before Hydra's schema."""
        if OWN_CONF.is_dir() and not OWN_CONF.samefile(conf_dir()):
            own = "working directory", f"file://{OWN_CONF.absolute()}"
            config_search_path.prepend(*own, anchor=SearchPathQuery(provider="schema"))
        super().__init__(config_search_path)

    def load_configuration(
        self, config_name: str | None, overrides: list[str], *flags: Any, **options: Any
    ) -> DictConfig:
        """Compose a configuration; `read_word`, `expand_arms` and `missing_profile` add to Hydra's words.

        Hydra composes a single run twice, first to learn that it is one: the second time is a copy.
        """
        words = expand_arms(map(read_word, overrides))
        composed: dict[tuple[str, ...], DictConfig] = vars(self).setdefault("composed", {})
        if (known := composed.get(tuple(words))) is not None:
            return copy.deepcopy(known)
        with decimal_numbers():
            values = super().load_configuration(config_name, words, *flags, **options)
            if profile := missing_profile(values, words):
                given = [*words, f"profile={profile}"]
                values = super().load_configuration(config_name, given, *flags, **options)
        if not any("," in word or "(" in word for word in words):
            composed[tuple(words)] = copy.deepcopy(values)
        return values

    def __getstate__(self) -> dict[str, Any]:
        """Leave out what was composed: a grid hands the loader to each of its runs."""
        return {key: value for key, value in vars(self).items() if key != "composed"}


def use_loader() -> None:
    """Let Hydra compose by `Loader` in this process.

    Raises:
        ConfigError: Hydra would take a bundled file in place of one of the working directory.
    """
    for path in sorted(OWN_CONF.glob("*/*.yaml")):
        bundled = conf_dir() / path.relative_to(OWN_CONF)
        is_bundled = path.parent.name not in ("case", "suite") and bundled.is_file()
        if is_bundled and path.read_bytes() != bundled.read_bytes():
            raise ConfigError(
                f"{path}: another {path.parent.name} of this name is bundled; allowed: rename it"
            )
    vars(hydra_parts)["ConfigLoaderImpl"] = Loader


def compose_config(*words: str) -> Config:
    """Compose and check the configuration of a run as the command does, without a run.

    Raises:
        ConfigError: a word or a value is wrong.
    """
    GlobalHydra.instance().clear()
    use_loader()
    try:
        with initialize_config_dir(str(conf_dir()), version_base="1.3"):
            return to_config(compose("config", list(words)))
    except HydraException as error:
        raise ConfigError(explain_hydra(error)) from None


def expand_arms(words: Iterable[str]) -> list[str]:
    """Replace a word such as `arm=FT3` by those that it stands for, unless their keys are given too.

    Several arms stay one word, until each run of the grid has its own.
    """
    given, found = {}, []
    for word in words:
        key, _, value = word.partition("=")
        name = value.strip("'\"")
        if key.lstrip("+") != "arm":
            found.append(word)
        elif NAME_OF_ARM.fullmatch(name) or "glob(" in name:
            # Of arms there are no files that a glob could find.
            try:
                given = Arm.parse(name).settings
            except ValueError:
                raise HydraException(f"Could not find 'arm/{name}'") from None
        else:
            found.append(f"+arm={value}")
    keys = {word.partition("=")[0].lstrip("+") for word in found}
    settings = [(key, "null" if value is None else value) for key, value in given.items() if key not in keys]
    return [*(f"{key}={value}" for key, value in settings), *found]


@contextmanager
def decimal_numbers() -> Iterator[None]:
    """Let OmegaConf read YAML as `read_yaml` does."""
    before = _utils.get_yaml_loader
    _utils.get_yaml_loader = lambda: LOADER
    try:
        yield
    finally:
        _utils.get_yaml_loader = before


def missing_profile(values: DictConfig, words: list[str]) -> str:
    """Return the profile that the suite of target or source asks for, empty if none or if one is given."""
    is_given = any(word.lstrip("+").startswith("profile=") for word in words)
    if is_given or values.hydra.runtime.choices.get("profile") != DEFAULT_PROFILE:
        return ""
    try:
        # In a grid of targets each run has one, and the grid has none.
        names = [values.get("target"), values.get("source")] if values.get("target") else []
        return next(filter(None, (profile_of(str(name)) for name in names)), "")
    except (ConfigError, OmegaConfBaseException):  # refused where the suite is loaded
        return ""


def read_word(word: str) -> str:
    """Quote text that Hydra would read as numbers, as in `output=2024_05_01,1e3`.

    Keys of `algorithm` and `transfer` that are in no file of conf/ pass: their check names the allowed ones.
    """
    key, equals, value = word.partition("=")
    name = key.lstrip("+").partition("@")[0]
    if key.startswith(("algorithm.", "transfer.")) and equals:
        key = f"++{key}"
    is_text = name in TEXT or "/" in name or ("." not in name and name not in NOT_TEXT)
    # A value with quotes, brackets or an interpolation is as its author wants it.
    if not is_text or set(value) & set("'\"[{$") or NUMERIC.search(value):
        return key + equals + value
    return key + equals + re.sub(r"[^\s,()]+", lambda found: quote(found[0]), value)


def quote(word: str) -> str:
    """Return a word in quotes if Hydra would read it as a number or a truth value."""
    try:
        float(word)
    except ValueError:
        return f"'{word}'" if word.lower() in ("true", "false") else word
    return f"'{word}'"


def explain_hydra(error: Exception) -> str:
    """Explain an error of Hydra in one line: the key, then what is allowed."""
    text = str(error)
    if found := re.match(r"(?:In '.*?': )?Could not find '([\w/-]+?)/([^/']*)'", text):
        group, name = found.groups()
        if name in EXTRAS:
            return f"{group}: {missing_extra(name, EXTRAS[name])}"
        return f"{group}: no {name}; allowed: {arm_names() if group == 'arm' else group_names(group)}"
    if found := re.match(
        r"Could not (?:override|append to config|delete from config)[^']*'?([\w.@/-]+)", text
    ):
        key = found[1].rstrip(".")
        if key in ("suite", "case"):
            return f"{key}: unknown key; write target=NAME; allowed: {group_names(key)}"
        if (conf_dir() / key).is_dir():
            return f"{key}: write +{key}=NAME; allowed: {group_names(key)}"
        path = key.split(".")[:-1]
        while not (known := keys_at(Config, tuple(path))):
            path.pop()
        if key in (".".join((*path, name)) for name in known):
            # With `+` a key must be new; without, a file must have it.
            sign, why = ("", "it has a value") if "append" in found[0] else ("+", "no file gives it a value")
            return f"{key}: {why}; write {sign}{key}=VALUE"
        return f"{key}: unknown key; allowed here: {', '.join(known)}"
    if found := re.match(r"Additional config directory '(.*)' not found", text):
        return f"--config-dir: no folder {found[1]}"
    text = " ".join(text.partition("\nSee https://hydra.cc")[0].split())
    # A value with characters of Hydra's grammar, as seed=0 in a path.
    hint = "; quote such a value twice: \"KEY='VALUE'\"" if isinstance(error, OverrideParseException) else ""
    return f"overrides: {text}{hint}"
