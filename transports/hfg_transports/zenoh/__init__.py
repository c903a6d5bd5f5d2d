"""Zenoh as a transport of hfg: datagrams, presence and questions between processes and hosts.

    settings    the settings file: realm, addresses, certificates, who may do what; every problem with its line
    config      Zenoh's configuration for them
    opening     opens Zenoh's session, and reports why it cannot
    keys        a secret that all programs have, as certificates
    diagnosing  finds out what Zenoh does not tell: why an address cannot be reached
    binding     the one module that imports Zenoh: its version, and what is marked unstable in it
    names       keys and names of hfg as Zenoh's key expressions
    inbox       from Zenoh's threads to the event loop, one wake-up per burst
    sending     puts; long ones from a thread of their own
    presence    announcements and watches over liveliness tokens
    asking      questions and answers
    declaring   what a session has declared, and withdraws before it closes
    versions    who else is in the realm, and whether it speaks the same
    ending      closes what a program that ends has left open
    foreign     sessions with programs that are not hfg's, such as nodes of ROS 2
    transport   the contract of `hfg.transport`, composed of these

Importing it needs no Zenoh; opening a session does: pip install 'hfg[zenoh]'.
"""

from hfg_transports.zenoh.opening import open_session
from hfg_transports.zenoh.settings import Access, Mode, Settings, SettingsProblem, Tls, read_settings
from hfg_transports.zenoh.transport import ZenohSession, ZenohTransport, transport

__all__ = [
    "Access",
    "Mode",
    "Settings",
    "SettingsProblem",
    "Tls",
    "ZenohSession",
    "ZenohTransport",
    "open_session",
    "read_settings",
    "transport",
]
