"""Nodes that speak with ROS 2 over rmw_zenoh, without ROS: topics, services, actions. Needs `hfg[ros2]`.

_topics    RosSubscribe, RosPublish
_services  RosService, RosServiceClient
_actions   RosAction
"""

from __future__ import annotations

from hfg.nodes.ros._actions import RosAction
from hfg.nodes.ros._services import RosService, RosServiceClient
from hfg.nodes.ros._topics import RosPublish, RosSubscribe

__all__ = ["RosAction", "RosPublish", "RosService", "RosServiceClient", "RosSubscribe"]
