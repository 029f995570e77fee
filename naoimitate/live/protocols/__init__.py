"""One file a protocol: bytes to landmarks and back, without sockets and clocks."""
