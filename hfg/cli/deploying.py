"""`hfg deploy --write`: files with which other supervisors run the parts of a graph: Docker, systemd, Kubernetes.

They hold names and addresses, and no secrets: the key of the realm is a credential of systemd, or a Secret of
Kubernetes. The templates are in `templates/`. Depends on `part`.
"""

from __future__ import annotations

import json
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

import yaml

from hfg.cli.new import filled, write_all
from hfg.cli.part import NAME_OF_MAIN, hosts_of
from hfg.errors import TargetError
from hfg.graph import Graph
from hfg.graph.flat import flatten

_PORT: Final = 7447  # of the first part; each has its own, as parts may share a host
_HEALTH_PORT: Final = 8080
_USER: Final = 10001  # in containers
_KEY: Final = "/run/secrets/hfg/cell.key"
_LONGEST_NAME: Final = 50  # Kubernetes allows 63 letters, suffixes included


@dataclass(frozen=True)
class _Part:
    """One part: its group, its name in files, its host, and the ports that it listens at on a host of its own."""

    group: str
    name: str
    host: str
    port: int
    health: int


@dataclass(frozen=True)
class Deployment:
    """What is to run.

    Attributes:
      graph: the graph.
      target: where it is found, from the folder in which the parts run.
      main_host: the name of the host of the main part.
      environment: further variables for all parts, such as HFG_ARG.
    """

    graph: Graph
    target: str
    main_host: str
    environment: Mapping[str, str]

    @property
    def name(self) -> str:
        """The name of the graph in files."""
        return _slug(self.graph.name)

    def parts(self) -> list[_Part]:
        """Return the parts, the main one first."""
        hosts = {NAME_OF_MAIN: self.main_host, **hosts_of(self.graph)}
        names = {group: f"{self.name}-{_slug(group)}" for group in hosts}
        if len(set(names.values())) < len(names):
            raise TargetError(
                f"groups would have the same name in files: {', '.join(sorted(names.values()))}; rename one"
            )
        return [
            _Part(group, names[group], host, _PORT + number, _HEALTH_PORT + number)
            for number, (group, host) in enumerate(hosts.items())
        ]

    def kept(self) -> list[str]:
        """Return the files in which groups keep their state, on the host of the main part."""
        groups = flatten(self.graph).groups.values()
        return [str(group.ledger) for group in groups if isinstance(group.ledger, str | Path)]


def environment_of(options: Mapping[str, Sequence[str] | None]) -> dict[str, str]:
    """Return options of `hfg part` as variables.

    Raises:
      TargetError: a value has spaces, at which the variable would be divided.
    """
    found = {}
    for option, values in options.items():
        for value in values or ():
            if value != "".join(value.split()) or not value.isprintable():
                raise TargetError(
                    f"--{option} {value!r} has spaces or control characters, which a list in the environment of a "
                    "service cannot hold: let the graph have this value"
                )
        if values:
            found[f"HFG_{option.upper()}"] = " ".join(values)
    return found


def write(what: Deployment, folder: Path) -> list[Path]:
    """Write all files into a folder that is new or empty, and return them.

    Raises:
      TargetError: there is something in the folder, or it cannot be written to, or the graph has no group with a host.
    """
    if folder.is_file() or folder.is_symlink() or (folder.is_dir() and any(folder.iterdir())):
        raise TargetError(
            f"{folder} is there already and not empty: hfg deploy overwrites nothing; name another folder"
        )
    parts = what.parts()
    texts = {"Dockerfile": _dockerfile(what), "kubernetes.yaml": _kubernetes(what, parts)}
    for part in parts:
        texts[f"systemd/hfg-{part.name}.service"] = _unit(what, part)
        texts[f"systemd/{part.name}.toml"] = _settings_on_host(what, part, parts)
    write_all({folder / place: text for place, text in texts.items()})
    return [folder / place for place in texts]


def _slug(name: str) -> str:
    slug = re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
    if not slug or len(slug) > _LONGEST_NAME or not slug[0].isalpha():
        raise TargetError(
            f'"{name:.100}" gives no name for a service: begin it with a letter, and take up to {_LONGEST_NAME} of '
            "a to z and 0 to 9"
        )
    return slug


def _toml(settings: Mapping[str, str | list[str]]) -> str:
    return "".join(f"{name} = {json.dumps(value, ensure_ascii=False)}\n" for name, value in settings.items())


def _settings_on_host(what: Deployment, part: _Part, parts: Sequence[_Part]) -> str:
    return _toml(
        {
            "realm": what.name,
            "host": part.name,
            "listen": [f"tls/{part.host}:{part.port}"],
            "agents": [f"tls/{one.host}:{one.port}" for one in parts if one is not part],
            "key": f"/run/credentials/hfg-{part.name}.service/cell.key",
        }
    )


def _settings_in_pod(what: Deployment, part: _Part, parts: Sequence[_Part]) -> str:
    return _toml(
        {
            "realm": what.name,
            "host": part.name,
            "listen": [f"tls/0.0.0.0:{_PORT}"],
            "connect": [f"tls/127.0.0.1:{_PORT}"],
            "agents": [f"tls/{one.name}:{_PORT}" for one in parts if one is not part],
            "key": _KEY,
        }
    )


def _dockerfile(what: Deployment) -> str:
    words = {
        "python": f"{sys.version_info.major}.{sys.version_info.minor}",
        "version": version("hfg"),
        "name": what.name,
        "target": json.dumps(what.target),
        "user": str(_USER),
    }
    return filled("dockerfile", words)


# --- systemd ---


def _unit(what: Deployment, part: _Part) -> str:
    variables = {
        "HFG_GRAPH": what.target,
        "HFG_GROUP": part.group,
        "HFG_SETTINGS": f"/etc/hfg/{part.name}.toml",
        "HFG_HEALTH": f"127.0.0.1:{part.health}",
        **what.environment,
    }
    words = {
        "name": part.name,
        "group": _in_unit(part.group),
        "graph": _in_unit(what.graph.name),
        "folder": f"/opt/{what.name}",
        "environment": "\n".join(f'Environment="{name}={_in_unit(value)}"' for name, value in variables.items()),
        "restart": "on-failure" if part.group == NAME_OF_MAIN else "always",
    }
    return filled("unit", words)


def _in_unit(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("%", "%%")


# --- Kubernetes ---


class _Dumper(yaml.SafeDumper):
    """Writes files inside of the manifest line by line."""


_Dumper.add_representer(
    str,
    lambda dumper, text: dumper.represent_scalar("tag:yaml.org,2002:str", text, style="|" if "\n" in text else None),
)


def _kubernetes(what: Deployment, parts: Sequence[_Part]) -> str:
    labels = {"app.kubernetes.io/name": what.name, "app.kubernetes.io/managed-by": "hfg"}
    objects: list[dict[str, Any]] = [
        {
            **_head("v1", "ConfigMap", f"{what.name}-settings", labels),
            "data": {f"{part.name}.toml": _settings_in_pod(what, part, parts) for part in parts},
        },
        _policy(what, labels),
    ]
    for part in parts:
        own = {**labels, "app.kubernetes.io/component": part.name}
        objects += [_service(part, own), _workload(what, part, own)]
    kept = "".join(f'#\n# The main part keeps state in "{one}": mount a volume there.\n' for one in what.kept())
    told = yaml.dump_all(objects, Dumper=_Dumper, sort_keys=False, allow_unicode=True, width=120)
    return filled("kubernetes", {"name": what.name, "kept": kept}) + told


def _head(version: str, kind: str, name: str, labels: Mapping[str, str]) -> dict[str, Any]:
    return {"apiVersion": version, "kind": kind, "metadata": {"name": name, "labels": dict(labels)}}


def _policy(what: Deployment, labels: Mapping[str, str]) -> dict[str, Any]:
    """Let only the parts reach each other, and everything reach the health checks."""
    these = {"matchLabels": dict(labels)}
    return {
        **_head("networking.k8s.io/v1", "NetworkPolicy", what.name, labels),
        "spec": {
            "podSelector": these,
            "policyTypes": ["Ingress"],
            "ingress": [
                {"from": [{"podSelector": these}], "ports": [{"port": _PORT}]},
                {"ports": [{"port": _HEALTH_PORT}]},
            ],
        },
    }


def _service(part: _Part, labels: Mapping[str, str]) -> dict[str, Any]:
    return {
        **_head("v1", "Service", part.name, labels),
        "spec": {
            "selector": dict(labels),
            "ports": [{"name": "hfg", "port": _PORT}],
            "publishNotReadyAddresses": True,  # parts find each other before they are ready
        },
    }


def _workload(what: Deployment, part: _Part, labels: Mapping[str, str]) -> dict[str, Any]:
    """The main part is a job, because a run has an end; each other part serves one run after the other."""
    pod = {"metadata": {"labels": dict(labels)}, "spec": _pod(what, part)}
    if part.group == NAME_OF_MAIN:
        pod["spec"]["restartPolicy"] = "OnFailure"
        return {**_head("batch/v1", "Job", part.name, labels), "spec": {"backoffLimit": 1_000_000, "template": pod}}
    spec = {"replicas": 1, "strategy": {"type": "Recreate"}, "selector": {"matchLabels": dict(labels)}, "template": pod}
    return {**_head("apps/v1", "Deployment", part.name, labels), "spec": spec}


def _pod(what: Deployment, part: _Part) -> dict[str, Any]:
    variables: dict[str, str] = {
        "HFG_GRAPH": what.target,
        "HFG_GROUP": part.group,
        "HFG_SETTINGS": f"/etc/hfg/{part.name}.toml",
        "HFG_HEALTH": f"$(POD_IP):{_HEALTH_PORT}",
        **what.environment,
    }
    address = {"name": "POD_IP", "valueFrom": {"fieldRef": {"fieldPath": "status.podIP"}}}
    container = {
        "name": "part",
        "image": f"{what.name}:latest",
        "imagePullPolicy": "IfNotPresent",
        "env": [address, *({"name": name, "value": value} for name, value in variables.items())],
        "ports": [{"containerPort": _PORT}, {"containerPort": _HEALTH_PORT}],
        "livenessProbe": {"httpGet": {"path": "/live", "port": _HEALTH_PORT}, "initialDelaySeconds": 15},
        "readinessProbe": {"httpGet": {"path": "/ready", "port": _HEALTH_PORT}},
        "securityContext": {"allowPrivilegeEscalation": False, "capabilities": {"drop": ["ALL"]}},
        "volumeMounts": [
            {"name": "settings", "mountPath": "/etc/hfg", "readOnly": True},
            {"name": "key", "mountPath": str(Path(_KEY).parent), "readOnly": True},
        ],
    }
    return {
        "securityContext": {"runAsNonRoot": True, "runAsUser": _USER, "runAsGroup": _USER, "fsGroup": _USER},
        "terminationGracePeriodSeconds": 20,
        "enableServiceLinks": False,  # else Kubernetes adds variables with names of its own
        "containers": [container],
        "volumes": [
            {"name": "settings", "configMap": {"name": f"{what.name}-settings"}},
            {"name": "key", "secret": {"secretName": f"{what.name}-key", "defaultMode": 0o440}},
        ],
    }
