"""The transport between programs of one user on one computer: local sockets in a folder that only this user can enter.

    place       the folder: its sockets, and the secret that proves who may take part
    proof       how both ends of a connection prove that they have the secret, and the seal on each frame
    wire        frames on a connection, as bytes
    connection  one connection: a socket that an event loop reads or writes
    session     the contract of `hfg.transport`: connections to all others in the place

Every session listens on a socket of its own in the folder and connects to all others that it finds there; whoever is
found by somebody new connects back. So there is no server, and nothing listens on a network address. Linux only.
"""

from hfg.links.local.session import LocalSession, LocalTransport, transport

__all__ = ["LocalSession", "LocalTransport", "transport"]
