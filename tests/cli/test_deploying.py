"""`hfg deploy --write` and `hfg part`: files for other supervisors, which those can read, without secrets (rule L5)."""

from __future__ import annotations

import configparser
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml

from tests.cli.conftest import Command

ROBOT = """
import hfg

@hfg.node
def square(value: int) -> int:
    return value * value

def build(factor: int = 1, name: str = "Fetch 100%") -> hfg.Graph:
    graph = hfg.Graph(name)
    graph.group("arm", host="right")
    graph.group("Left eye", host="left", ledger="eye.ledger")
    graph.group("near", process=True)
    first, second = graph.add(square(), name="a", group="arm"), graph.add(square(), name="b", group="Left eye")
    third = graph.add(square(), name="c", group="near")
    graph.connect(graph.input("value", int), first.value)
    graph.connect(first.out, second.value)
    graph.connect(second.out, third.value)
    graph.connect(third.out, graph.output("out", int))
    return graph
"""
NAMES = ["fetch-100-main", "fetch-100-arm", "fetch-100-left-eye"]


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "robot", raising=False)
    (tmp_path / "robot.py").write_text(ROBOT)
    return tmp_path


@pytest.fixture
def deployed(command: Command, robot: Path) -> Path:
    shown = command("deploy", "robot.py", "--write", "deploy", "--on", "base", "--arg", "factor=2")
    assert shown.code == 0, shown.err
    assert 'the main part keeps state in "eye.ledger"' in shown.err
    folder = robot / "deploy"
    assert shown.out.split() == [str(file.relative_to(robot)) for file in map(folder.joinpath, FILES)]
    return folder


FILES = [
    "Dockerfile",
    "kubernetes.yaml",
    *(f"systemd/{place}" for name in NAMES for place in (f"hfg-{name}.service", f"{name}.toml")),
]


def test_settings_of_all_parts_name_each_other_and_are_what_hfg_reads(deployed: Path) -> None:
    zenoh = pytest.importorskip("hfg_transports.zenoh.settings", reason="Zenoh is not installed")
    manifests = list(yaml.safe_load_all((deployed / "kubernetes.yaml").read_text()))
    (mapped,) = [one["data"] for one in manifests if one["kind"] == "ConfigMap"]
    assert list(mapped) == [f"{name}.toml" for name in NAMES]
    texts = [mapped, {f"{name}.toml": (deployed / "systemd" / f"{name}.toml").read_text() for name in NAMES}]
    for one in texts:
        for name, text in one.items():
            file = deployed / name
            key = deployed / "cell.key"
            key.write_text("0" * 64)
            key.chmod(0o600)
            file.write_text(re.sub(r'(?m)^key = ".*"$', f'key = "{key}"', text))
            settings = zenoh.read_settings(file)
            assert settings.realm == "fetch-100"
            assert f"{settings.host}.toml" == name
            assert len(settings.agents) == 2
            assert not settings.insecure
    hosts = [re.findall(r'listen = \["tls/(.*):(.*)"\]', text) for text in texts[1].values()]
    assert hosts == [[("base", "7447")], [("right", "7448")], [("left", "7449")]]


def test_units_are_what_systemd_accepts(deployed: Path) -> None:
    for name in NAMES:
        unit = configparser.ConfigParser(strict=False, interpolation=None)
        unit.optionxform = str  # type: ignore[assignment,method-assign]
        unit.read(deployed / "systemd" / f"hfg-{name}.service")
        assert unit["Service"]["Restart"] == ("on-failure" if name.endswith("main") else "always")
    text = (deployed / "systemd" / "hfg-fetch-100-left-eye.service").read_text()
    assert 'Environment="HFG_GROUP=Left eye"' in text
    assert 'of the hfg graph "Fetch 100%%"' in text.replace("\\", "")
    if shutil.which("systemd-analyze") is None:
        pytest.skip("systemd-analyze is not installed (on Debian and Ubuntu the package systemd)")
    for name in NAMES:
        file = deployed / "systemd" / f"hfg-{name}.service"
        file.write_text(file.read_text().replace("/opt/fetch-100/.venv/bin/hfg", sys.executable))
        told = subprocess.run(
            ["systemd-analyze", "verify", "--man=no", str(file)], capture_output=True, text=True, check=False
        )
        about = [line for line in told.stderr.splitlines() if "hfg-" in line]
        assert not about, about


def test_manifest_runs_each_part_as_an_ordinary_user_with_checks_and_the_key_as_a_secret(deployed: Path) -> None:
    manifests: list[dict[str, Any]] = list(yaml.safe_load_all((deployed / "kubernetes.yaml").read_text()))
    kinds = [one["kind"] for one in manifests]
    assert kinds == ["ConfigMap", "NetworkPolicy", *["Service", "Job"], *["Service", "Deployment"] * 2]
    names = [one["metadata"]["name"] for one in manifests if one["kind"] == "Service"]
    assert names == NAMES
    for one in manifests:
        if one["kind"] not in ("Job", "Deployment"):
            continue
        pod = one["spec"]["template"]["spec"]
        (container,) = pod["containers"]
        told = {entry["name"]: entry.get("value") for entry in container["env"]}
        assert told["HFG_SETTINGS"] == f"/etc/hfg/{one['metadata']['name']}.toml"
        assert told["HFG_ARG"] == "factor=2"
        assert pod["securityContext"]["runAsNonRoot"] is True
        assert container["livenessProbe"]["httpGet"] == {"path": "/live", "port": 8080}
        assert [volume["secret"]["secretName"] for volume in pod["volumes"] if "secret" in volume] == ["fetch-100-key"]


def test_dockerfile_starts_a_part(deployed: Path) -> None:
    lines = (deployed / "Dockerfile").read_text().splitlines()
    assert lines[-1] == 'ENTRYPOINT ["hfg", "part"]'
    assert any(line.startswith("USER ") and line != "USER root" for line in lines)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--write", "full"], "is there already and not empty"),
        (["--write", "new", "--until", "3"], "--write starts nothing"),
        (["--write", "new", "--param", "a.b=1 2"], "has spaces or control characters"),
        (["--write", "new", "--arg", "name=!!"], "gives no name for a service"),
    ],
)
def test_what_cannot_be_deployed_says_why_and_writes_nothing(
    command: Command, robot: Path, arguments: list[str], said: str
) -> None:
    (robot / "full").mkdir()
    (robot / "full" / "file").touch()
    shown = command("deploy", "robot.py", *arguments)
    assert shown.code == 2
    assert said in shown.err
    assert not (robot / "new").exists()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["robot.py", "leg"], 'has no part "leg"; its parts are "main", "arm", "Left eye"'),
        (["robot.py", "near"], 'has no part "near"'),
        (["robot.py", "arm", "--health", "8080"], "write host:port"),
        (["whole.py", "main"], "has no group with a host"),
    ],
)
def test_what_is_no_part_says_which_there_are(command: Command, robot: Path, arguments: list[str], said: str) -> None:
    (robot / "whole.py").write_text("import hfg\ngraph = hfg.Graph('whole')\n")
    (robot / "cell.toml").touch()
    shown = command("part", *arguments, "--settings", "cell.toml")
    assert shown.code in (1, 2)
    assert said in shown.err
