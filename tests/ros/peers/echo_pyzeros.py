"""Echoes topics and serves a service with pyzeros, an implementation of rmw_zenoh that shares no code with hfg's.

Called by tests/ros/test_peers.py as `python echo_pyzeros.py ADDRESS`, in an environment that has pyzeros.
"""

from __future__ import annotations

import asyncio
import json
import sys

import pyzeros
import zenoh
from ros2_pyterfaces.cydr.all_msgs import Image, LaserScan, String, Twist
from ros2_pyterfaces.cydr.all_srvs import SetBool

TYPES = {"string": String, "image": Image, "twist": Twist, "scan": LaserScan}


def session() -> zenoh.Session:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("connect/endpoints", json.dumps([sys.argv[1]]))
    return zenoh.open(config)


async def echo(name: str, kind: type) -> None:
    publisher = pyzeros.Pub(kind, f"/pyzeros/back/{name}")
    subscription = pyzeros.Sub(kind, f"/pyzeros/there/{name}")  # kept: its generator does not keep it
    async for value in subscription.listen_reliable():
        publisher.publish(value)


async def serve() -> None:
    server = pyzeros.Server(SetBool, "/pyzeros/flip")
    async for asked in server.listen_reliable():
        asked.response.success = not asked.request.data
        asked.response.message = b"pyzeros"  # its text is bytes
        asked.send()


async def ask() -> None:
    """Ask hfg's service whenever a message says so, and tell what it has answered."""
    publisher, client = pyzeros.Pub(String, "/pyzeros/told"), pyzeros.Client(SetBool, "/hfg/flip")
    wishes = pyzeros.Sub(String, "/pyzeros/ask")
    async for _ in wishes.listen_reliable():
        await client.wait_for_service()
        answer = await client.call_async(SetBool.Request(data=True))
        publisher.publish(String(data=b"%s %s" % (str(answer.success).encode(), answer.message)))


async def main() -> None:
    with pyzeros.auto_context(node="pyzeros_peer", zenoh_session=session()):
        work = [echo(name, kind) for name, kind in TYPES.items()]
        tasks = [asyncio.ensure_future(one) for one in (*work, serve(), ask())]
        await asyncio.sleep(0)
        for kind in (*TYPES.values(), SetBool.Request, SetBool.Response):
            kind.deserialize(kind().serialize())  # compiles it, at the first time ever for half a minute
        print("ready", flush=True)
        over = asyncio.get_running_loop().run_in_executor(None, sys.stdin.read)
        done, _ = await asyncio.wait([over, *tasks], return_when="FIRST_COMPLETED")
        for one in done - {over}:
            one.result()
        for one in tasks:
            one.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)


asyncio.run(main())
