"""ROS 2 without ROS: names, keys, tokens and messages as rmw_zenoh writes them.

names       valid names, full names, remapping, names of types
wire        keys of topics and services, tokens of the graph, attachments, quality of service
messages    types of messages, services and actions: hashes, bytes, values
values      what hfg has for messages
goals       the bytes of an action
graph       the entities that tokens announce
connection  a session with a router, opened as soon as the router is there; the only module that waits
"""

from hfg.ros.messages import ActionType, MessageType, ServiceType, action, message, service

__all__ = ["ActionType", "MessageType", "ServiceType", "action", "message", "service"]
