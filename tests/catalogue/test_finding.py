"""Node types are found in the library, in installed distributions and in modules; what is broken stops nobody."""

from __future__ import annotations

import subprocess
import sys

import pytest

from hfg.catalogue import Catalogue, Offer, installed, offers, types_of
from hfg.registry import find
from tests.catalogue.conftest import Install

GOOD = '''
import hfg


@hfg.node
def brighter(value: float) -> float:
    """Give more."""
    return value + 1


@hfg.node
def _hidden(value: float) -> float:
    return value


class Plain:
    pass
'''


def plug_ins() -> Catalogue:
    """Those of the distributions that a test installed."""
    return installed(offer for offer in offers() if offer.module != "hfg.nodes")


def references(found: Catalogue) -> list[str]:
    return [one.reference for one in found.types]


def test_an_installed_module_is_found_and_loaded_when_used(install: Install) -> None:
    install("lamps", {"lamps": "lamps_nodes"}, lamps_nodes=GOOD)
    assert Offer("lamps_nodes", "", 'the entry point "lamps" of lamps') in offers()
    assert "lamps_nodes" not in sys.modules  # to say where types may be needs no import
    assert plug_ins() == Catalogue(plug_ins().types, ())
    assert references(plug_ins()) == ["lamps_nodes:brighter"]
    assert find("lamps_nodes:brighter")() is not None


def test_a_package_is_walked(install: Install) -> None:
    install(
        "lamps",
        {"lamps": "lamps.nodes"},
        lamps__in____init__="",
        lamps__in__nodes__in____init__=GOOD.replace("brighter", "first"),
        lamps__in__nodes__in__deep__in____init__=GOOD.replace("brighter", "second"),
        lamps__in__nodes__in__deep__in__well=GOOD.replace("brighter", "third"),
        lamps__in__nodes__in__test_well="raise RuntimeError('a test is no plug-in')",
        lamps__in__nodes__in___inner="raise RuntimeError('and neither is what has an underscore')",
        lamps__in__other="raise RuntimeError('this is not offered')",
    )
    assert references(plug_ins()) == ["lamps.nodes:first", "lamps.nodes.deep:second", "lamps.nodes.deep.well:third"]
    assert plug_ins().problems == ()


def test_a_type_that_a_package_lists_is_found_once_and_under_its_name(install: Install) -> None:
    install(
        "lamps",
        {"lamps": "lamps", "again": "lamps.colours"},
        lamps__in____init__="from lamps.colours import brighter\n__all__ = ['brighter']",
        lamps__in__colours=GOOD,
    )
    assert references(plug_ins()) == ["lamps:brighter"]


def test_one_type_may_be_offered_alone(install: Install) -> None:
    code = GOOD + "\n\n@hfg.node\ndef darker(value: float) -> float:\n    return value - 1\n"
    install("lamps", {"lamps": "lamps_nodes:darker"}, lamps_nodes=code)
    assert references(plug_ins()) == ["lamps_nodes:darker"]


def test_a_module_may_make_its_types_when_asked(install: Install) -> None:
    code = """
        import hfg

        def _make(name):
            def function(value: float) -> float:
                return value
            function.__name__ = function.__qualname__ = name
            return hfg.node(function)

        def __node_types__():
            for name in ("red", "green"):
                globals().setdefault(name, _make(name))
                yield globals()[name]
    """
    install("lamps", {"lamps": "lamps_made"}, lamps_made=code)
    assert references(plug_ins()) == ["lamps_made:red", "lamps_made:green"]


@pytest.mark.parametrize(
    ("entry", "code", "sentence"),
    [
        ("nowhere_at_all", "", 'there is no module "nowhere_at_all", which the entry point "bad" of bad names: is'),
        ("bad_nodes", "1 / 0", 'bad_nodes, which the entry point "bad" of bad names, cannot be imported: ZeroDivis'),
        ("bad_nodes", "import no_such_thing", 'needs the module "no_such_thing", which is not installed'),
        ("bad_nodes", "def", "SyntaxError"),
        ("bad_nodes", "raise SystemExit(3)", "called sys.exit when it was imported"),
        ("bad_nodes", "import hfg\n@hfg.node\ndef f(x): ...", 'argument "x" has no annotation'),
        ("bad_nodes", "def __node_types__(): return [3]", "__node_types__() returned 3, which is not a node type"),
        ("bad_nodes:nothing", "", "names bad_nodes:nothing, which has no such name"),
        ("bad_nodes:some", "some = 3", "names bad_nodes:some, which is neither a node type nor a module"),
    ],
)
def test_a_broken_plug_in_is_told_in_a_sentence_and_stops_nobody(
    install: Install, entry: str, code: str, sentence: str
) -> None:
    install("bad", {"bad": entry}, bad_nodes=code)
    install("lamps", {"lamps": "lamps_nodes"}, lamps_nodes=GOOD)
    found = plug_ins()
    assert references(found) == ["lamps_nodes:brighter"]
    (problem,) = found.problems
    assert sentence in problem
    assert "\n" not in problem


def test_a_broken_module_of_a_package_stops_none_of_the_others(install: Install) -> None:
    install(
        "lamps", {"lamps": "lamps"}, lamps__in____init__="", lamps__in__a="oh no", lamps__in__b=GOOD, lamps__in__c=""
    )
    found = plug_ins()
    assert references(found) == ["lamps.b:brighter"]
    assert [problem.partition(" ")[0] for problem in found.problems] == ["lamps.a"]


def test_a_named_module_that_is_not_there_is_a_problem_too() -> None:
    assert types_of("no.such.module").problems[0].startswith('there is no module "no.such.module"')


@pytest.mark.slow
def test_the_library_is_offered_first_and_is_sound() -> None:
    assert offers()[0] == Offer("hfg.nodes")
    found = types_of("hfg.nodes")
    assert found.problems == ()
    assert found.types
    assert all(find(one.reference)._type.reference == one.reference for one in found.types)


@pytest.mark.slow
def test_to_say_where_types_may_be_imports_no_family() -> None:
    code = (
        "import sys; from hfg.catalogue import offers; assert offers()[0].module == 'hfg.nodes'; "
        "print([name for name in sys.modules if name.startswith('hfg.nodes')])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
