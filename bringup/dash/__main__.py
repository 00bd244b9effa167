"""The page's own process beside `acftc run --dash`: ``python -m bringup.dash PORT DOMAIN SOCKET...``."""

import os
import socket
import sys

from ac_ros_common.process_exit import end_with_parent, leave
from bringup.dash.server import TOKEN_VARIABLE, Address, Door, serve


def main() -> None:
    """Serve on the sockets that the parent has opened, until it ends."""
    end_with_parent()
    port, domain, *numbers = map(int, sys.argv[1:])
    sockets = [socket.socket(fileno=number) for number in numbers]
    from bringup.dash.link import Link

    link = Link(domain, is_starting=True)
    try:
        serve(Address(sockets, Door(port, os.environ.get(TOKEN_VARIABLE, "")), ""), link)
    finally:
        link.close()
    leave(0)


if __name__ == "__main__":
    main()
