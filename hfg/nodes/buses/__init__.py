"""Buses and services: connections with the world outside, each as a node that is connected while it is active.

    _connection   Message, and what all connections have in common
    _streams      TcpClient, SerialLine
    _sockets      TcpServer, Udp
    _programs     Subprocess
    _mqtt         MqttPublish, MqttSubscribe
    _websockets   WebSocketClient, WebSocketServer
    _http         HttpClient, HttpServer, Request, Response

A connection lives while its node is active, or for the whole run if nothing can activate it. A lost one is made again;
a slow graph slows the other side, and losses are counted in the report. A type imports its package when it is used, and
names the extra that installs it.
"""

from hfg.nodes.buses._connection import Message
from hfg.nodes.buses._http import HttpClient, HttpServer, Request, Response
from hfg.nodes.buses._mqtt import MqttPublish, MqttSubscribe
from hfg.nodes.buses._programs import Subprocess
from hfg.nodes.buses._sockets import TcpServer, Udp
from hfg.nodes.buses._streams import SerialLine, TcpClient
from hfg.nodes.buses._websockets import WebSocketClient, WebSocketServer

__all__ = [
    "HttpClient",
    "HttpServer",
    "Message",
    "MqttPublish",
    "MqttSubscribe",
    "Request",
    "Response",
    "SerialLine",
    "Subprocess",
    "TcpClient",
    "TcpServer",
    "Udp",
    "WebSocketClient",
    "WebSocketServer",
]
