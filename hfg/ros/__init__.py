"""ROS 2 without ROS: names, keys, tokens and messages as rmw_zenoh writes them; no network, no loop.

names   what is valid, full names, remapping, names of types
wire    keys of topics and services, tokens of the graph, attachments, quality of service
graph   who is there
"""
