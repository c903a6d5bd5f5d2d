"""ROS 2 without ROS: names, keys, tokens and messages as rmw_zenoh writes them.

names       valid names, full names, remapping, names of types
wire        keys of topics and services, tokens of the graph, attachments, quality of service
messages    types of messages, services and actions: hashes, bytes, values
definitions what a type consists of, its hash and its records, through rosbags
services    the types in a service and in an action
files       `.msg`, `.srv` and `.action` files
typestore   a set of definitions that are used together
fitting     checks records before they are encoded
records     the classes of records, by name
values      what hfg has for messages, with pictures and clouds
goals       the bytes of an action
graph       the entities that tokens announce
connection  a session with a router, opened as soon as the router is there; the only module that waits
"""

from hfg.ros.messages import ActionType, MessageType, ServiceType, action, message, register, service

__all__ = ["ActionType", "MessageType", "ServiceType", "action", "message", "register", "service"]
