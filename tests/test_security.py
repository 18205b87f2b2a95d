"""No line of the package unpickles or executes what somebody else may have written: syntax trees say so."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.test_layering import FILES, PACKAGE

# Modules that unpickle, execute, or read formats that can: none is imported, whatever it would be used for.
MODULES = {
    *(
        "pickle",
        "_pickle",
        "cPickle",
        "cloudpickle",
        "dill",
        "jsonpickle",
        "joblib",
        "shelve",
        "marshal",
        "dbm",
    ),
    *("xml", "lxml", "tarfile", "zipfile", "code", "codeop", "runpy", "pty", "pydoc"),
}
# Functions by the end of their name, whichever module it is that has them.
FUNCTIONS = {
    *("read_pickle", "full_load", "full_load_all", "unsafe_load", "unsafe_load_all", "load_all"),
    *("unpack_archive", "extractall", "instantiate", "register_new_resolver", "exec_module"),
    *("spec_from_file_location", "import_module", "run_path", "run_module", "load_state_dict_from_url"),
}
BUILT_IN = {"eval", "exec", "compile", "__import__", "breakpoint"}
SHELL = {"os.system", "os.popen", "os.execv", "os.execl", "os.spawnl", "os.spawnv", "subprocess.getoutput"}
# A loader of YAML that makes no objects.
SAFE_LOADERS = {"SafeLoader", "CSafeLoader"}

# Each with the reason why it may stand there.
ALLOWED = {
    # FILE.py:function and module:function name somebody's own program, on their command line and nowhere
    # else: no file that we read can name one.
    ("policies.py", "importlib.import_module"),
    ("policies.py", "importlib.util.spec_from_file_location"),
    ("policies.py", "spec.loader.exec_module"),
}


def dotted(node: ast.expr, names: dict[str, str]) -> str:
    """The name of what is called, as it was imported: `np.load` is `numpy.load`."""
    if isinstance(node, ast.Name):
        return names.get(node.id, node.id)
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value, names)}.{node.attr}"
    return ""


def imported(tree: ast.AST) -> dict[str, str]:
    """What each name of a file stands for."""
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            # `import a.b` binds a.
            for one in node.names:
                first = one.name.split(".")[0]
                names[one.asname or first] = one.name if one.asname else first
        elif isinstance(node, ast.ImportFrom):
            names |= {(a.asname or a.name): f"{node.module}.{a.name}" for a in node.names}
    return names


def says(call: ast.Call, keyword: str) -> object:
    """The constant that a keyword is given, its loader's or other name, or None without it."""
    for one in call.keywords:
        if one.arg == keyword:
            return one.value.value if isinstance(one.value, ast.Constant) else ast.unparse(one.value)
    return None


def dangers(source: str) -> Iterator[str]:
    """Everything in a file that unpickles or executes, by name."""
    tree = ast.parse(source)
    names = imported(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            modules = [a.name for a in node.names] if isinstance(node, ast.Import) else [str(node.module)]
            yield from (module for module in modules if module.split(".")[0] in MODULES)
            yield from (f"{modules[0]}.{a.name}" for a in node.names if a.name in FUNCTIONS)
        elif isinstance(node, ast.Name | ast.Attribute):
            # Not calls alone: `loader = pickle.load` is as bad.
            name = dotted(node, names)
            short = name.rpartition(".")[2]
            if short in FUNCTIONS or name in SHELL or (name in BUILT_IN and isinstance(node, ast.Name)):
                yield name
        elif isinstance(node, ast.Call):
            name = dotted(node.func, names)
            if says(node, "shell") not in (None, False):
                yield f"{name}(shell)"
            if name == "torch.load" and says(node, "weights_only") is not True:
                yield name
            if says(node, "allow_pickle") not in (None, False):
                yield f"{name}(allow_pickle)"
            if name == "yaml.load" and str(says(node, "Loader")).rpartition(".")[2] not in SAFE_LOADERS:
                yield name


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_file_of_the_package_unpickles_or_executes(path: Path) -> None:
    where = str(path.relative_to(PACKAGE))
    found = {name for name in dangers(path.read_text()) if (where, name) not in ALLOWED}
    assert not found, f"{where}: {', '.join(sorted(found))}"


def test_every_exception_is_still_needed() -> None:
    found = {(file, name) for file, _ in ALLOWED for name in dangers((PACKAGE / file).read_text())}
    assert found == ALLOWED


@pytest.mark.parametrize(
    "bad",
    [
        "import pickle",
        "import os, pickle as p",
        "from joblib import load",
        "import xml.etree.ElementTree as tree",
        "import numpy as np\nnp.load(path, allow_pickle=True)",
        "import numpy as np\nnp.load(path, allow_pickle=trusted)",
        "import torch\ntorch.load(path)",
        "from torch import load as read\nread(path, weights_only=False)",
        "import pandas as pd\npd.read_pickle(path)",
        "import yaml\nyaml.load(text, Loader=yaml.Loader)",
        "import yaml\nyaml.load(text)",
        "from yaml import unsafe_load",
        "import yaml\nread = yaml.full_load",
        "eval(text)",
        "run = exec",
        "__import__(name)",
        "import os\nos.system(line)",
        "from os import system as do\ndo(line)",
        "import subprocess\nsubprocess.run(line, shell=True)",
        "import subprocess as s\ns.Popen(line, shell=wanted)",
        "import shutil\nshutil.unpack_archive(path)",
        "archive.extractall(folder)",
        "from hydra.utils import instantiate",
        "import hydra\nhydra.utils.instantiate(config)",
        "from importlib import import_module\nimport_module(name)",
    ],
)
def test_each_of_these_would_be_found(bad: str) -> None:
    assert list(dangers(bad))


@pytest.mark.parametrize(
    "good",
    [
        "network.eval()",
        "import re\nre.compile('a')",
        "import yaml\nyaml.safe_load(text)",
        "import yaml\nyaml.load(text, Loader=yaml.SafeLoader)",
        "import torch\ntorch.load(path, weights_only=True)",
        "import numpy as np\nnp.load(path)",
        "import subprocess\nsubprocess.run(line)",
        "import json\njson.load(file)",
    ],
)
def test_what_is_harmless_is_not(good: str) -> None:
    assert not list(dangers(good))
