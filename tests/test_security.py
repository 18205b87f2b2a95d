"""No line of the package unpickles or executes what somebody else may have written: syntax trees say so."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.test_layering import FILES, PACKAGE

# Modules that unpickle, execute, or read formats that can: none is imported, whatever it would be used for.
MODULES_TEXT = """pickle _pickle cPickle cloudpickle dill jsonpickle joblib shelve marshal dbm xml lxml
    tarfile zipfile code codeop runpy pty pydoc posix"""
MODULES = set(MODULES_TEXT.split())
# Functions and classes by the end of their name, whichever module has them.
FUNCTIONS_TEXT = """read_pickle read_hdf HDFStore read_parquet read_array full_load full_load_all unsafe_load
    unsafe_load_all load_all FullLoader UnsafeLoader CLoader CFullLoader CUnsafeLoader FullConstructor
    UnsafeConstructor unpack_archive extractall instantiate register_new_resolver exec_module
    spec_from_file_location import_module run_path run_module load_state_dict_from_url
    create_subprocess_shell subprocess_shell"""
FUNCTIONS = set(FUNCTIONS_TEXT.split())
BUILT_IN = {"eval", "exec", "compile", "__import__", "breakpoint"}
# Others by their whole name, or by its beginning: `os.exec` is all of that family.
NAMES = {"os.system", "subprocess.getoutput", "subprocess.getstatusoutput", "yaml.Loader"}
NAMES |= {f"{module}.{name}" for module in ("builtins", "__builtins__") for name in BUILT_IN}
FAMILIES = (
    *("os.popen", "os.exec", "os.spawn", "os.posix_spawn"),
    *("torch.jit.", "torch.hub.", "torch.package.", "torch.export.load", "onnx.hub."),
)
# Harmless only by how they are called, so that their names may stand nowhere but in such a call.
LOADERS = {"torch.load", "torch.serialization.load", "numpy.load", "yaml.load"}
# A loader of YAML that makes no objects.
SAFE_LOADERS = {"SafeLoader", "CSafeLoader"}

# Each with the reason why it may stand there.
ALLOWED = {
    # The verb of a command line, which is one of a fixed list.
    ("__main__.py", "importlib.import_module"),
    # FILE.py:function and module:function name somebody's own program, on their command line and nowhere
    # else: no file that we read can name one.
    ("policies/named.py", "importlib.import_module"),
    ("policies/named.py", "importlib.util.spec_from_file_location"),
    ("policies/named.py", "spec.loader.exec_module"),
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


def harmless(call: ast.Call, name: str) -> bool:
    """Whether one of `LOADERS` is called so that it makes nothing but values."""
    if name == "yaml.load":
        return str(says(call, "Loader")).rpartition(".")[2] in SAFE_LOADERS
    if name == "numpy.load":
        # Its third argument is allow_pickle, which `*` and `**` may hold too.
        starred = any(isinstance(one, ast.Starred) for one in call.args)
        unnamed = any(one.arg is None for one in call.keywords)
        return len(call.args) < 3 and not starred and not unnamed
    return says(call, "weights_only") is True


def imports(node: ast.Import | ast.ImportFrom) -> Iterator[str]:
    """What an import names that unpickles or executes."""
    first = [] if isinstance(node, ast.Import) else [node.module or "."]
    for one in node.names:
        name = ".".join([*first, one.name])
        parts = name.split(".")
        # Also where another package has it: `pandas.io.pickle`.
        bad = bool(MODULES & set(parts)) or parts[-1] in FUNCTIONS or dangerous(name) or name in NAMES
        # What a star brings would be found under no module's name.
        if bad or one.name == "*":
            yield name


def dangerous(name: str) -> bool:
    """Whether a name is in one of the families, or is its module."""
    return name.startswith(FAMILIES) or f"{name}." in FAMILIES


def dangers(source: str) -> Iterator[str]:
    """Everything in a file that unpickles or executes, by name."""
    tree = ast.parse(source)
    names = imported(tree)
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
    allowed = {id(call.func) for call in calls if harmless(call, dotted(call.func, names))}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from imports(node)
        elif isinstance(node, ast.Name | ast.Attribute):
            # Not calls alone: `loader = pickle.load` is as bad.
            name = dotted(node, names)
            bad = name.rpartition(".")[2] in FUNCTIONS or name in NAMES or dangerous(name)
            built_in = name in BUILT_IN and isinstance(node, ast.Name)
            if bad or built_in or (name in LOADERS and id(node) not in allowed):
                yield name
        elif isinstance(node, ast.Call):
            for keyword in ("shell", "allow_pickle"):
                if says(node, keyword) not in (None, False):
                    yield f"{dotted(node.func, names)}({keyword})"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_file_of_the_package_unpickles_or_executes(path: Path) -> None:
    where = str(path.relative_to(PACKAGE))
    found = {name for name in dangers(path.read_text()) if (where, name) not in ALLOWED}
    assert not found, f"{where}: {', '.join(sorted(found))}"


def test_every_exception_is_still_needed() -> None:
    found = {(file, name) for file, _ in ALLOWED for name in dangers((PACKAGE / file).read_text())}
    assert found == ALLOWED


BAD = """\
import pickle
import os, pickle as p
from joblib import load
from pandas.io import pickle
import xml.etree.ElementTree as tree
import numpy as np; np.load(path, allow_pickle=True)
import numpy as np; np.load(path, allow_pickle=trusted)
import numpy as np; np.load(path, None, True)
import numpy as np; np.load(path, **how)
import numpy as np; np.load(*given)
import numpy as np; read = np.load; read(path, None, True)
import torch; torch.load(path)
import torch; read = torch.load; read(path)
from torch import load as read; read(path, weights_only=False)
from torch.serialization import load; load(path)
import torch; torch.jit.load(path)
import torch; torch.hub.load(place, name)
from torch import hub
import torch; torch.export.load(path)
from torch.package import PackageImporter
import pandas as pd; pd.read_parquet(path)
import yaml; yaml.load(text, Loader=yaml.Loader)
import yaml; yaml.load(text)
import yaml; read = yaml.load; read(text, yaml.Loader)
import yaml; yaml.Loader(text).get_data()
import yaml; read = yaml.full_load
from yaml import unsafe_load
from yaml import Loader as SafeLoader
eval(text)
run = exec
__import__(name)
from builtins import exec as do; do(text)
import os; os.system(line)
from os import system as do; do(line)
import os; os.execvp(line[0], line)
import os; os.posix_spawnp(path, line, {})
from os import *
import subprocess; subprocess.run(line, shell=True)
import subprocess as s; s.Popen(line, shell=wanted)
import subprocess; subprocess.getoutput(line)
import asyncio; asyncio.create_subprocess_shell(line)
import shutil; shutil.unpack_archive(path)
archive.extractall(folder)
import hydra; hydra.utils.instantiate(config)
from importlib import import_module; import_module(name)"""
GOOD = """\
network.eval()
import re; re.compile('a')
import yaml; yaml.safe_load(text)
import yaml; yaml.load(text, Loader=yaml.SafeLoader)
import torch; torch.load(path, weights_only=True)
from torch import load as read; read(path, weights_only=True)
import numpy as np; np.load(path)
import numpy as np; np.load(path, mmap_mode='r', allow_pickle=False)
import os; os.path.exists(path)
torch.export.export(network, ())
import subprocess; subprocess.run(line)
import json; json.load(file)"""


def test_bad_lines_are_found_and_good_ones_are_not() -> None:
    assert [line for line in BAD.splitlines() if not list(dangers(line))] == []
    assert [line for line in GOOD.splitlines() if list(dangers(line))] == []
